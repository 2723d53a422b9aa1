"""Linear checks: L2 gain, strict positive realness, bandwidth, and the loops they apply to."""

from .band import (
    BandwidthVerdict,
    NoBandwidthWarning,
    UnstableLoopWarning,
    bandwidth,
    bandwidth_check,
)
from .delayed import DelayedTransfer, delayed, linearize
from .designs import DesignChecks, check_designs
from .l2 import L2Verdict, l2_check
from .loops import (
    position_L,
    position_loop_tf,
    position_T,
    velocity_L,
    velocity_loop_tf,
    velocity_T,
)
from .passivity import PassivityVerdict, passivity_check
from .spr import Repair, SprVerdict, spr_check, spr_repair
from .stability import AxisAsLoopWarning, StabilityVerdict, stability_check

__all__ = [
    "AxisAsLoopWarning",
    "BandwidthVerdict",
    "DelayedTransfer",
    "DesignChecks",
    "L2Verdict",
    "NoBandwidthWarning",
    "PassivityVerdict",
    "Repair",
    "SprVerdict",
    "StabilityVerdict",
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
