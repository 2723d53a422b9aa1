"""Intervals from what differs between repetitions, with what a register and a clock cannot tell."""

from __future__ import annotations

import numpy as np
from scipy import stats

from ..core.numeric import Z95
from ..estimates.findings import Estimate

SCALE = 1e-3  # relative error of any scale and clock, standard deviation


def student(freedom: float) -> float:
    """Half the width of a 95 % interval in standard errors."""
    return float(stats.t.ppf(0.975, max(freedom, 1.0)))


def interval(
    value: float, error: float, freedom: float, unit: str, *, resolution: float = 0.0
) -> Estimate:
    """A value with its 95 % interval: of its standard error with so many degrees of freedom, and
    of a standard deviation that is known."""
    known = np.hypot(resolution, SCALE * value)
    half = np.hypot(student(freedom) * error, Z95 * known)
    return Estimate(float(value), unit, (float(value - half), float(value + half)))
