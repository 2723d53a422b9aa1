"""Parameter changes: fitted values far from the declared ones, and what in a drive acts so."""

from __future__ import annotations

import numpy as np

from ..model import Model
from .fit import Fitted

FAR = 0.2  # of the declared value, from which a change is mentioned
ALIKE = 0.05  # relative spread within which factors count as equal
SCALED = ("J", "Fc", "Fv")  # among the values that a wrong scale of the torque multiplies
MOVED = "{} is {:.0f} % {} the declared {:.4g} {}"
SCALE = (
    "all by the factor {:.3g}: if the declared values are right, the scale of u is wrong (torque "
    "constant, gear ratio)"
)
DEAD_ZONE = (
    "if the declared values are right, check the actuator, too: while u and w have the same sign, "
    "its dead zone acts like Fc; record braking by the torque to distinguish them"
)


def far_off(fitted: Fitted, declared: Model) -> list[str]:
    """A sentence on values far from the declared ones, with what could be the cause.

    A value is not mentioned if its interval contains the declared one. The error of a declared
    value is unknown: whether the drive changed must be judged by who declared it.
    """
    factors = _factors(fitted, declared)
    if not factors:
        return []
    moved = [
        MOVED.format(
            key, abs(100 * (r - 1)), "above" if r > 1 else "below",
            fitted.values[key] / r, declared.unit(key),
        )
        for key, r in factors.items()
    ]  # fmt: skip
    return ["; ".join([", ".join(moved), *_like(factors)]) + "."]


def _factors(fitted: Fitted, declared: Model) -> dict[str, float]:
    """Fitted over declared value of those that differ clearly."""
    intervals, made = fitted.intervals(), {}
    for key in (*SCALED, "Fs"):
        old = declared.values().get(key)
        if not old or key not in intervals:
            continue
        low, high = intervals[key]
        if abs(fitted.values[key] / old - 1.0) > FAR and not low <= old <= high:
            made[key] = fitted.values[key] / old
    return made


def _like(factors: dict[str, float]) -> list[str]:
    """Known causes of such changes."""
    scaled = np.array([factors.get(key, 0.0) for key in SCALED])
    if scaled.all() and np.ptp(scaled) < ALIKE * scaled.mean():
        return [SCALE.format(scaled.mean())]
    return [DEAD_ZONE] if factors.get("Fc", 0.0) > 1.0 else []
