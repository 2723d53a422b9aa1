"""One loop bench: friction compensation before and after, how much of it to dare on drives that are
not exactly the model, and friction observers at equal terms."""

from .assure import Assurance, assure
from .chance import HuntingChance, hunting_chance, seen_in
from .compare import Compared, ObserverComparison, compare_observers
from .compensate import Compensation, Run, compensate
from .loop import effects_torque
from .recommend import Candidate, Recommendation, recommend_observer

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
