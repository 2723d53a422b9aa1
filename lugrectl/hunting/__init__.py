"""Friction limit cycles of position loops, by the map from stick to stick."""

from .hunt import limit_cycles
from .map import HuntingMap, hunting_map
from .result import Cycle, LimitCycles

__all__ = ["Cycle", "HuntingMap", "LimitCycles", "hunting_map", "limit_cycles"]
