"""Codes in place of values: a 0 or a full-scale mark where no answer came."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from .outliers import outside, resolution

_FEWEST = 5  # rows that a code fills, off the curve through the others
_MOST = 0.3  # of all rows; a value that is held longer is one
_BRIEF = 4  # rows, a code stands for one answer or a few


def code(x: np.ndarray) -> np.ndarray:
    """Where a channel (N,), all finite, holds a code instead of a value.

    A code is one value that comes again and again, each time for a few rows, far off the curve
    through the other rows, while these go on smoothly.
    """
    values, counts = np.unique(x, return_counts=True)
    if len(values) < 20:
        return np.zeros(len(x), bool)
    often = values[np.argsort(-counts)[:2]]
    for value in dict.fromkeys((0.0, *often, values[0], values[-1])):
        at = x == value
        if _FEWEST <= at.sum() <= _MOST * len(x):
            found = _brief(at)
            if found.sum() >= max(_FEWEST, 0.8 * at.sum()) and _off(x, found, value):
                return found
    return np.zeros(len(x), bool)


def _brief(at: np.ndarray) -> np.ndarray:
    """The rows in runs of a few."""
    edges = np.flatnonzero(np.diff(np.r_[False, at, False]))
    made = np.zeros(len(at), bool)
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        made[a:b] = b - a <= _BRIEF
    return made


def _off(x: np.ndarray, at: np.ndarray, value: float) -> bool:
    """Whether the value is mostly far outside the rows on either side."""
    others = np.flatnonzero(~at)
    if len(others) < 16:
        return False
    steps = np.abs(np.diff(x[others], append=x[others[-1]]))
    rough = ndimage.maximum_filter1d(ndimage.median_filter(steps, 9, mode="nearest"), 9)
    here = np.searchsorted(others, np.flatnonzero(at))
    before, after = x[others[(here - 1).clip(0)]], x[others[here.clip(0, len(others) - 1)]]
    here = here.clip(0, len(others) - 1)
    low, high = np.quantile(x[others], [0.01, 0.99])
    limit = 8 * rough[here] + 6 * resolution(x[others]) + 0.02 * (high - low)
    far = outside(value, before, after) > limit
    return bool(far.sum() >= _FEWEST and far.mean() > 0.5)
