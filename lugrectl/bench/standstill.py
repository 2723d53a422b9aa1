"""Whether a drive stands still after it was stopped: what the end of a simulated run says."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

RESTS, UNDECIDED, HUNTS = 0.0, 1.0, 2.0
CONSTANT = 1e-6  # of its range, by which the torque of a drive at rest still moves
SHRINKS = 0.9  # of its size a third before: a swing that does not persist
SETTLES = 0.5  # the same of a torque that approaches its end: what is left is less than this moved
BLOCKS = 8  # means of the torque
LINE = 4.0  # times their distance from it; eight random means reach that once in 600 times
SLOW = 1e-3  # of the range of the torque: so slow it takes a thousand such runs to break away


class Rest(NamedTuple):
    """The fate of a run, the worst last in order, and the swing at its end, peak to peak."""

    fate: float
    swing: float

    @classmethod
    def diverged(cls) -> Rest:
        return cls(HUNTS, math.inf)


def at_rest(theta: np.ndarray, u: np.ndarray, range_u: float, still: float, last: bool) -> Rest:
    """What the last thirds of a run say of a swing above ``still``; ``last``: no longer one comes.

    A constant torque rests. In a stick with an error the integrator moves the torque one way until
    the drive breaks away: then nothing is decided, also where it has not moved for long.
    """
    third = len(theta) // 3
    before, now = slice(-2 * third, -third), slice(-third, None)
    size, was = float(np.ptp(theta[now])), float(np.ptp(theta[before]))
    moved = float(np.ptp(u[now]))
    if moved <= CONSTANT * range_u:
        return Rest(RESTS, size)
    if min(size, was) > still and (last or size >= SHRINKS * was):
        return Rest(HUNTS, size)
    stays = not _one_way(u[-2 * third :], range_u) or moved <= SETTLES * np.ptp(u[before])
    if max(size, was) <= still and stays:
        return Rest(RESTS, size)
    return Rest(UNDECIDED, max(size, was))


def _one_way(u: np.ndarray, range_u: float) -> bool:
    """Whether means of the torque move along a line, by far more than they lie about it, and so
    fast that a thousand such runs would cross its range."""
    means = np.array([np.mean(part) for part in np.array_split(u, BLOCKS)])
    place = np.arange(BLOCKS)
    line = np.polyval(np.polyfit(place, means, 1), place)
    moved = abs(line[-1] - line[0])
    return bool(moved > max(LINE * np.max(np.abs(means - line)), SLOW * range_u))
