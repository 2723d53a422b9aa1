"""Friction observers compared at equal terms, by simulation of one drive."""

from .face import compare_observers
from .result import Compared, ObserverComparison

__all__ = ["Compared", "ObserverComparison", "compare_observers"]
