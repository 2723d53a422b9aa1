"""Friction compensation with an augmented model: the loop before and after, simulated."""

from .face import compensate
from .feeding import effects_torque
from .result import Compensation, Run

__all__ = ["Compensation", "Run", "compensate", "effects_torque"]
