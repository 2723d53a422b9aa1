"""Simulation of a model along its records: errors before and after, residuals, a last polish."""

from .errors import Judged, errors, residuals, torque_noise
from .polish import Polished, polish
from .prepared import HeldOut, Prepared, prepared

__all__ = [
    "HeldOut",
    "Judged",
    "Polished",
    "Prepared",
    "errors",
    "polish",
    "prepared",
    "residuals",
    "torque_noise",
]
