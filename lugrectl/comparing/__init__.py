"""Friction observers compared at equal terms, by simulation of one drive."""

from .face import compare_observers
from .recommend import recommend_observer
from .recommendation import Candidate, Recommendation
from .result import Compared, ObserverComparison

__all__ = [
    "Candidate",
    "Compared",
    "ObserverComparison",
    "Recommendation",
    "compare_observers",
    "recommend_observer",
]
