"""Cycles that never stick: at each w = 0 the torque is above Fs. Found by following the swings.

Their state has two numbers, so that only those that attract are found here.
"""

from __future__ import annotations

import numpy as np

from .lanes import Lanes
from .slip import slip
from .stick_map import LARGE, NEVER

SWINGS = 100  # that are followed, at most
STARTS = 4  # of the errors from which no stick followed
ALIKE = 1e-6  # relative change from swing to swing, below which it repeats
SAME = 1e-3  # relative difference of two amplitudes that are one


def swinging(lanes: Lanes, x: np.ndarray, D: np.ndarray) -> list[tuple[float, float, float]]:
    """Amplitude, period and multiplier of a turn of each, in units."""
    never = x[D >= NEVER]
    if not len(never):
        return []
    at = never[np.unique(np.linspace(0, len(never) - 1, STARTS).astype(int))]
    excess, change, found = np.zeros(len(at)), np.ones(len(at)), []
    for _ in range(SWINGS):
        end = slip(lanes[np.zeros(len(at), int)], at, excess)
        new, excess, before = -end.x, -2.0 - end.y, change
        change = new / at - 1.0
        again = np.abs(change) < ALIKE
        ratio = (change / before) ** 2  # of two half turns
        found += zip(new[again], 2.0 * end.t[again], ratio[again], strict=True)
        goes = ~(end.rests | (excess <= 0.0) | (new > LARGE) | again)
        at, excess, change = new[goes], excess[goes], change[goes]
        if not len(at):
            break
    return _different(found)


def _different(found: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    made: list[tuple[float, float, float]] = []
    for one in sorted(found):
        if not made or abs(one[0] / made[-1][0] - 1.0) > SAME:
            made.append((float(one[0]), float(one[1]), float(one[2])))
    return made
