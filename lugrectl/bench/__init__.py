"""One loop bench: friction compensation before and after, how much of it to dare on drives that are
not exactly the model, and friction observers at equal terms."""

from .assure import Assurance, HuntingChance, assure, hunting_chance, seen_in
from .compensate import Compensation, Run, compensate
from .loop import effects_torque
from .observers import (
    Candidate,
    Compared,
    ObserverComparison,
    Recommendation,
    compare_observers,
    recommend_observer,
)

__all__ = [
    "Assurance",
    "Candidate",
    "Compared",
    "Compensation",
    "HuntingChance",
    "ObserverComparison",
    "Recommendation",
    "Run",
    "assure",
    "compare_observers",
    "compensate",
    "effects_torque",
    "hunting_chance",
    "recommend_observer",
    "seen_in",
]
