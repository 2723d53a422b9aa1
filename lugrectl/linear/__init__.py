"""Linear checks: L2 gain, strict positive realness, bandwidth, and the loops they apply to."""

from .band import NoBandwidthWarning, UnstableLoopWarning, bandwidth, bandwidth_check
from .delayed import DelayedTransfer, delayed, linearize
from .designs import check_designs
from .l2 import l2_check
from .loops import (
    position_L,
    position_loop_tf,
    position_T,
    velocity_L,
    velocity_loop_tf,
    velocity_T,
)
from .passivity import passivity_check
from .spr import spr_check, spr_repair
from .stability import AxisAsLoopWarning, stability_check

__all__ = [
    "AxisAsLoopWarning",
    "DelayedTransfer",
    "NoBandwidthWarning",
    "UnstableLoopWarning",
    "bandwidth",
    "bandwidth_check",
    "check_designs",
    "delayed",
    "l2_check",
    "linearize",
    "passivity_check",
    "position_L",
    "position_T",
    "position_loop_tf",
    "spr_check",
    "spr_repair",
    "stability_check",
    "velocity_L",
    "velocity_T",
    "velocity_loop_tf",
]
