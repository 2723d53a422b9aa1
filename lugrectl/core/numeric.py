"""Sums of numbers that several rooms need."""

from __future__ import annotations

import numpy as np

Z95 = 1.96  # standard errors in half a 95 % interval


def top_speed(w: np.ndarray) -> float:
    """The speed below which 95 % of the path is covered, however long the drive rests."""
    ordered = np.sort(np.abs(w), axis=None)
    path = np.cumsum(ordered)
    return float(ordered[np.searchsorted(path, 0.95 * path[-1])]) if len(path) else 0.0


def column_sizes(x: np.ndarray) -> np.ndarray:
    """Norms of the columns (k,); 1 for a column that is 0 throughout, which explains nothing."""
    size = np.linalg.norm(x, axis=0)
    return np.where(size == 0, 1.0, size)


def rms(e: np.ndarray) -> float:
    """Root mean square; inf where a simulation diverged."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(e**2)))
