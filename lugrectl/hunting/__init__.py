"""Friction limit cycles of position loops, by the map from stick to stick."""

from .hunt import Cycle, LimitCycles, limit_cycles
from .loop import HuntingMap, hunting_map
from .stick_slip import StickSlip, stick_slip_speed

__all__ = [
    "Cycle",
    "HuntingMap",
    "LimitCycles",
    "StickSlip",
    "hunting_map",
    "limit_cycles",
    "stick_slip_speed",
]
