"""Linear checks: L2 gain, strict positive realness, bandwidth, and the loops they apply to."""

from .band import BandwidthVerdict, UnstableLoopWarning, bandwidth, bandwidth_check
from .designs import DesignChecks, check_designs
from .l2 import L2Verdict, l2_check
from .loops import position_loop_tf, position_T, velocity_loop_tf, velocity_T
from .repair import Repair
from .spr import SprVerdict, spr_check, spr_repair

__all__ = [
    "BandwidthVerdict",
    "DesignChecks",
    "L2Verdict",
    "Repair",
    "SprVerdict",
    "UnstableLoopWarning",
    "bandwidth",
    "bandwidth_check",
    "check_designs",
    "l2_check",
    "position_T",
    "position_loop_tf",
    "spr_check",
    "spr_repair",
    "velocity_T",
    "velocity_loop_tf",
]
