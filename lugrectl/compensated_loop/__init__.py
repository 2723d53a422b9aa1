"""Friction compensation with an augmented model: the loop before and after, simulated."""

from .compensate import compensate
from .feedforward import effects_torque
from .result import Compensation, Run

__all__ = ["Compensation", "Run", "compensate", "effects_torque"]
