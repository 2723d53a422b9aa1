"""A signal later or earlier by a part of a sample, by a cubic spline."""

from __future__ import annotations

import numpy as np

EDGE = 12  # samples beyond the ends of a stretch that a spline through it knows


def spline(x: np.ndarray) -> np.ndarray:
    """Coefficients of the cubic spline through x, with EDGE more on each side."""
    from scipy.ndimage import spline_filter1d  # slow to import

    return spline_filter1d(np.pad(x, EDGE, mode="edge"), 3, mode="nearest")


def shifted(c: np.ndarray, by: float) -> np.ndarray:
    """The spline ``by`` samples later, the first and last value held."""
    n, whole = len(c) - 2 * EDGE, int(np.floor(by))
    s = 1.0 - (by - whole)  # after the earlier of the samples in the middle
    weights = ((1 - s) ** 3, 4 - 6 * s**2 + 3 * s**3, 1 + 3 * s + 3 * s**2 - 3 * s**3, s**3)
    held = np.pad(c, abs(whole) + 2, mode="edge")
    first = EDGE + abs(whole) - whole
    parts = [k / 6 * held[first + i : first + i + n] for i, k in enumerate(weights)]
    return parts[0] + parts[1] + parts[2] + parts[3]
