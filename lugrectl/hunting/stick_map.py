"""From stick to stick: the state of a PID loop in a stick is its error alone.

At rest the error of a stick is constant and u changes by -ki e, so that breakaway is towards zero,
at |u| = Fs. A stop of the same sign may follow, or a reversal without a stop (|u| > Fs at w = 0).
The half-turn map T(e) goes from breakaway at e > 0 to the first stick on the other side, which it
counts positive; it is continuous where stops appear and vanish, which the map from stop to stop is
not.

Under the reference r = v t the error changes by -v in a stick and U = -(kp e + ki int e) by
kp v - ki e: the drive breaks away forward where kp v > ki e, else backward. In units, and with
x = -e, the excess y = U - Fs of a stick is y0 + (v + rho x0) t + rho v t^2/2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .loop import Lanes
from .slip import slip

STICKS, RESTS, GROWS, SWINGS = 0, 1, 2, 3  # fate: next stick, rest, too large, never a stick
REVERSALS, MOVING = 300, 20  # without a stick, after which a loop swings; under a reference
RISES = 4  # reversals at a larger and larger error and torque, after which it goes on so
ALIKE = 1e-4  # relative change from reversal to reversal of a swing that repeats
STOPS = 60  # on one side, after which a loop creeps: it comes to rest
NEVER = 50.0  # the excess of what rests (negative) or never sticks


@dataclass
class Turn:
    """What happened up to the next stick of each lane.

    ``x`` its error (units), signed for a stop and positive for a half turn, and ``y`` its excess;
    ``t`` the time with the wait for breakaway, ``high`` and ``low`` the largest errors on the side
    of the start and on the other, ``stops``.
    """

    x: np.ndarray
    y: np.ndarray
    t: np.ndarray
    high: np.ndarray
    low: np.ndarray
    stops: np.ndarray
    fate: np.ndarray

    @classmethod
    def begun(cls, x: np.ndarray) -> Turn:
        stops, fate = np.zeros((2, len(x)), int)
        return cls(x.copy(), 0.0 * x, np.zeros(len(x)), x.copy(), 0.0 * x, stops, fate)

    def reach(self, lanes: np.ndarray, high: np.ndarray, low: np.ndarray) -> None:
        """Note errors that some lanes reached on either side."""
        self.high[lanes] = np.maximum(self.high[lanes], high)
        self.low[lanes] = np.maximum(self.low[lanes], low)


def next_stick(lanes: Lanes, x: np.ndarray) -> Turn:
    """Follow each lane from breakaway at x to the next stick, through reversals without one.

    At rest x > 0; under a reference x = -e, and breakaway is forward or backward.
    """
    made, active, v, at = Turn.begun(x), np.arange(len(x)), lanes.drift, x.copy()
    excess, side, rises = np.zeros(len(x)), np.ones(len(x)), np.zeros(len(x), int)
    if v is not None:
        side = np.where(v + lanes.rho * x >= 0.0, 1.0, -1.0)
        at = side * x
    for _ in range(REVERSALS if v is None else MOVING):
        own = lanes[active]
        end = slip(own if v is None else replace(own, drift=side * v[active]), at, excess)
        made.t[active] += end.t
        made.x[active], made.y[active] = side * end.x, np.where(side > 0.0, end.y, -2.0 - end.y)
        made.reach(active, side * end.x, -side * end.x)
        ahead, over = -end.x, -2.0 - end.y
        fate = np.where(end.rests, RESTS, np.where(over <= 0.0, STICKS, SWINGS))
        if v is None:
            wait = np.where(end.x > 0.0, -end.y, -over) / (own.rho * np.abs(end.x) + 1e-300)
            made.t[active] += np.where(fate == STICKS, wait, 0.0)
            fate[np.abs(end.x) > lanes.large] = GROWS
        repeats = (np.abs(ahead - at) < ALIKE * at) & (np.abs(over - excess) < ALIKE * at)
        rises = np.where((ahead > at) & (over > excess), rises + 1, 0)
        made.fate[active] = fate
        goes = (fate == SWINGS) & ((v is not None) | ~(repeats | (rises >= RISES)))
        active, side, at = active[goes], -side[goes], ahead[goes]
        excess, rises = over[goes], rises[goes]
        if not len(active):
            break
    return made


def half_turn(lanes: Lanes, x: np.ndarray) -> Turn:
    """Return T(x): from breakaway at x > 0 to the first stick on the other side."""
    made, active, at = Turn.begun(x), np.arange(len(x)), x.copy()
    for _ in range(STOPS):
        one = next_stick(lanes[active], at)
        made.t[active] += one.t
        made.reach(active, one.high, one.low)
        made.stops[active] += one.fate == STICKS
        made.fate[active], made.x[active] = one.fate, np.abs(one.x)
        stays = (one.fate == STICKS) & (one.x > 0.0)
        made.fate[active[stays & (one.x <= lanes.calm)]] = RESTS
        goes = stays & (one.x > lanes.calm)
        active, at = active[goes], one.x[goes]
        if not len(active):
            break
    made.fate[active] = RESTS
    return made


def turns(lanes: Lanes, x: np.ndarray, count: int = 1) -> Turn:
    """Apply T so many times."""
    made, active = Turn.begun(x), np.arange(len(x))
    for k in range(count):
        one = half_turn(lanes[active], made.x[active])
        made.t[active] += one.t
        made.stops[active] += one.stops
        made.reach(active, *((one.low, one.high) if k % 2 else (one.high, one.low)))
        made.x[active], made.fate[active] = one.x, one.fate
        active = active[one.fate == STICKS]
        if not len(active):
            break
    return made


def excess(lanes: Lanes, x: np.ndarray, count: int = 1) -> np.ndarray:
    """Return log(T(x)/x), -NEVER for what comes to rest, NEVER for what never sticks or grows."""
    made = turns(lanes, x, count)
    with np.errstate(divide="ignore"):
        return _bounded(np.log(made.x / x), made.fate)


def _bounded(D: np.ndarray, fate: np.ndarray) -> np.ndarray:
    return np.where(fate == STICKS, D, np.where(fate == RESTS, -NEVER, NEVER))


def excess_on(lanes: Lanes, x: np.ndarray, loops: int = 1) -> np.ndarray:
    """:func:`excess` of so many loops on an increasing grid, with one slip from each error.

    A stop on the same side, at S(x) < x, goes on as from there: T(x) = T(S(x)), interpolated.
    A row for each loop.
    """
    made = next_stick(lanes, np.tile(x, loops))
    rows = zip(made.x.reshape(loops, -1), made.fate.reshape(loops, -1), strict=True)
    return np.array([_followed(np.log(x), stop, fate) for stop, fate in rows])


def _followed(place: np.ndarray, stop: np.ndarray, fate: np.ndarray) -> np.ndarray:
    """D on a grid of log errors from the next stick of each."""
    stays = (fate == STICKS) & (stop > 0.0)
    with np.errstate(divide="ignore"):
        logT = np.log(np.abs(stop))
    for i in np.flatnonzero(stays):
        if i == 0:
            fate[0] = RESTS
            continue
        at = np.interp(logT[i], place[:i], np.arange(i))
        low, part = int(at), at % 1.0
        high = min(low + 1, i - 1)
        fate[i] = fate[low if part < 0.5 else high]
        logT[i] = logT[low] + part * (logT[high] - logT[low])
    return _bounded(logT - place, fate)
