"""Sums of numbers that several rooms need."""

from __future__ import annotations

import numpy as np


def rms(e: np.ndarray) -> float:
    """Root mean square; inf where a simulation diverged."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(e**2)))
