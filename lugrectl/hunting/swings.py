"""Cycles that never stick: at each w = 0 the torque is above Fs. Found by following the swings.

Their state has two numbers, so that only those that attract are found here.
"""

from __future__ import annotations

import numpy as np

from .lanes import Lanes
from .slip import slip
from .stick_map import LARGE, NEVER

TURNS = 400  # swings that are followed, at most
STARTS = 4  # of the errors from which no stick followed
ALIKE = 1e-6  # relative change from swing to swing, below which it repeats
SAME = 1e-3  # relative difference of two amplitudes that are one


def swinging(lanes: Lanes, x: np.ndarray, D: np.ndarray) -> list[tuple[float, float, float]]:
    """Amplitude, period and multiplier of a turn of each, in units."""
    never = np.flatnonzero(D >= NEVER)
    if not len(never):
        return []
    starts = x[never[np.unique(np.linspace(0, len(never) - 1, STARTS).astype(int))]]
    found = [one for start in starts if (one := _followed(lanes, start))]
    made: list[tuple[float, float, float]] = []
    for one in found:
        if all(abs(one[0] / other[0] - 1.0) > SAME for other in made):
            made.append(one)
    return made


def _followed(lanes: Lanes, start: float) -> tuple[float, float, float] | None:
    at, excess, change = np.array([start]), np.zeros(1), 1.0
    for _ in range(TURNS):
        end = slip(lanes, at, excess)
        if end.rests[0] or end.y[0] >= -2.0 or abs(end.x[0]) > LARGE:
            return None
        new, excess = -end.x, -2.0 - end.y
        before, change = change, float((new[0] - at[0]) / at[0])
        at = new
        if abs(change) < ALIKE:
            ratio = change / before if before else 0.0
            return float(at[0]), float(2.0 * end.t[0]), ratio**2
    return None
