"""Stamps that jitter: the rows were sampled when they are stamped, or evenly and stamped late."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from .outliers import bridged, off_cubic_in_time
from .rows import Stamped

_WIDTH = 51  # rows over which the true clock is even
_SMOOTHER = 1.5  # times, to believe the count of rows more than the stamps


def use_true_times(log: Stamped) -> None:
    """Replace stamps by a smooth clock where that makes the motion much smoother."""
    x = log.channels.get("theta", log.channels.get("w"))
    if x is None:
        return
    t = log.t.copy()
    for part in log.parts():
        values = x[part]
        good = np.isfinite(values)
        if part.stop - part.start > 2 * _WIDTH and good.mean() > 0.5:
            t[part] = _believed(log.t[part], bridged(values, ~good))
    if not np.array_equal(t, log.t):
        rms = float(np.std(t - log.t))
        log.say(
            f"The motion is much smoother over an even clock than over the stamps of t: they were "
            f"given late ({rms:.2g} s RMS), and the even clock was used."
        )
        log.t = t


def _believed(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    steps = np.diff(t)
    if np.std(steps) < 0.02 * np.mean(steps) or steps.max() > 20 * np.mean(steps):
        return t
    rows = np.arange(len(t))
    line = np.polyval(np.polyfit(rows, t, 1), rows)
    late = ndimage.median_filter(t - line, _WIDTH, mode="nearest")
    even = line + ndimage.uniform_filter1d(late, _WIDTH, mode="nearest")
    if np.any(np.diff(even) <= 0) or np.abs(np.diff(late)).max() > 3 * np.mean(steps):
        return t  # rows are missing
    return even if _roughness(t, x) > _SMOOTHER * _roughness(even, x) else t


def _roughness(t: np.ndarray, x: np.ndarray) -> float:
    """The usual distance of a sample from the cubic in time through its neighbours."""
    return float(np.nanmean(np.sqrt(off_cubic_in_time(t, x))) ** 2)
