"""One loop bench: friction compensation before and after, how much of it to dare on drives that are
not exactly the model, and friction observers at equal terms."""

from .assure import assure
from .assured import Assurance
from .believed import seen_in
from .compare import compare_observers
from .comparison import Compared, ObserverComparison
from .compensate import compensate
from .compensation import Compensation, Run
from .feedforward import effects_torque
from .hunting_chance import HuntingChance, hunting_chance
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
