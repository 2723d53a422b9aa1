from .errors import Judged, errors, residuals, torque_noise
from .prepared import HeldOut, Prepared, prepared

__all__ = [
    "HeldOut",
    "Judged",
    "Prepared",
    "errors",
    "prepared",
    "residuals",
    "torque_noise",
]
