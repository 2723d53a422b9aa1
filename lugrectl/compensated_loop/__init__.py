"""Friction compensation: the loop before and after, and how much of it to dare on drives that are
not exactly the model."""

from .assure import assure
from .assured import Assurance
from .believed import seen_in
from .compensate import compensate
from .feedforward import effects_torque
from .hunting_chance import HuntingChance, hunting_chance
from .result import Compensation, Run

__all__ = [
    "Assurance",
    "Compensation",
    "HuntingChance",
    "Run",
    "assure",
    "compensate",
    "effects_torque",
    "hunting_chance",
    "seen_in",
]
