"""One loop bench: friction compensation before and after, how much of it to dare on drives that are
not exactly the model, and friction observers at equal terms."""

from .assure import Assurance, assure
from .believed import seen_in
from .chance import HuntingChance, hunting_chance
from .compare import Compared, ObserverComparison, compare_observers
from .compensate import Compensation, Run, compensate
from .feedforward import effects_torque
from .recommend import recommend_observer
from .recommendation import Candidate, Recommendation

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
