"""Linear checks: L2 gain, strict positive realness, bandwidth, and the loops they are about."""

from .band import BandwidthVerdict, UnstableLoopWarning, bandwidth, bandwidth_check
from .l2 import L2Verdict, l2_check
from .loops import position_loop_tf, position_T, velocity_loop_tf, velocity_T
from .spr import SprVerdict, spr_check

__all__ = [
    "BandwidthVerdict",
    "L2Verdict",
    "SprVerdict",
    "UnstableLoopWarning",
    "bandwidth",
    "bandwidth_check",
    "l2_check",
    "position_T",
    "position_loop_tf",
    "spr_check",
    "velocity_T",
    "velocity_loop_tf",
]
