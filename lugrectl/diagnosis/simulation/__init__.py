"""Simulation of a model along its records: errors before and after, residuals, a last polish."""

from .judge import Judged, errors, residuals, torque_noise
from .polishing import Polished, polish
from .records import HeldOut, Prepared, prepared

__all__ = ["HeldOut", "Judged", "Polished", "Prepared", "errors", "polish", "prepared"]
__all__ += ["residuals", "torque_noise"]
