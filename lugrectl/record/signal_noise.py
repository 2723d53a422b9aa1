"""The noise of a sampled signal, without a model of what made it."""

from __future__ import annotations

import numpy as np

from .record import smallest_step

_THIRD_DIFFERENCE = np.sqrt(20.0)  # std of white noise of unit variance, differenced three times
NORMAL_MAD = 0.6745  # median absolute value of a unit normal variable


def sensor_noise(x: np.ndarray, resolution: float = 0.0) -> float:
    """Standard deviation of a sampled signal's own noise, estimated without a model.

    Computed from the median size of the third differences, which are near zero for a finely
    sampled motion. Never below the rounding noise of the ``resolution`` (a step of q: q /
    sqrt(12)). The smallest step in the samples is used as well, but interpolated samples do not
    show it. The estimate is too high if the motion itself changes within four samples.
    """
    x = x[np.isfinite(x)]
    third = np.abs(np.diff(x, 3))
    spread = float(np.median(third)) / NORMAL_MAD / _THIRD_DIFFERENCE
    return max(spread, max(resolution, smallest_step(x)) / np.sqrt(12.0))


def repeating(x: np.ndarray, resolution: float = 0.0) -> float:
    """Usual number of samples after which a signal changes its value; 1 if it always does.

    Samples between two encoder counts share one rounding error and carry the information of one
    sample.
    """
    x = x[np.isfinite(x)]
    least = 0.5 * max(resolution, smallest_step(x))
    changed = np.flatnonzero(np.abs(np.diff(x)) > least)
    return float(np.median(np.diff(changed))) if len(changed) > 1 else 1.0
