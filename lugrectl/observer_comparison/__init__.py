"""Friction observers compared at equal terms, by simulation of one drive."""

from .compare import compare_observers
from .comparison import Compared, ObserverComparison
from .recommend import recommend_observer
from .recommendation import Candidate, Recommendation

__all__ = [
    "Candidate",
    "Compared",
    "ObserverComparison",
    "Recommendation",
    "compare_observers",
    "recommend_observer",
]
