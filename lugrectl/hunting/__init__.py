"""Friction limit cycles of position loops, by the map from stick to stick."""

from .hunt import limit_cycles
from .map import HuntingMap, hunting_map
from .result import Cycle, LimitCycles
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
