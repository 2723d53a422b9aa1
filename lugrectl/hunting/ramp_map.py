"""Stick-slip of a rigid loop under the reference r = v t: from breakaway to breakaway.

In a stick the error changes by -v and U = -(kp e + ki int e) by kp v - ki e, so that the drive
breaks away at U = Fs or -Fs with an error as its only free number: forward where kp v > ki e, else
backward. In units, and with x = -e, the excess y = U - Fs of a stick is
y0 + (v + rho x0) t + rho v t^2/2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .lanes import Lanes, Loop
from .slip import slip

REVERSALS = 20  # without a stick, after which a drive swings and sticks no more
STARTS, FOLLOWED = 16, 4  # errors at breakaway of a speed, and how many images of them
SMALLEST = 0.03  # units, of these errors
SLOW, STRIDE = 0.2, 0.3  # shares of the way to where it repeats: of a slow breakaway, of a stride
SLOWEST = 3e-4  # the least such share that is known
ROUNDS, BRIEF = 60, 12  # slips, after which what still sticks persists, or may do so
ALIKE = 1e-4  # relative change from breakaway to breakaway of what repeats


def next_breakaway(lanes: Lanes, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The error x of the next breakaway from one at x, and whether there is one."""
    made, sticks = x.copy(), np.zeros(len(x), bool)
    v = np.asarray(lanes.drift)
    side = np.where(v + lanes.rho * x >= 0.0, 1.0, -1.0)
    at, excess, active = side * x, 0.0 * x, np.arange(len(x))
    for _ in range(REVERSALS):
        own = lanes[active]
        end = slip(replace(own, drift=side * v[active]), at, excess)
        stops = ~end.rests & (end.y >= -2.0)
        y = np.where(side > 0.0, end.y, -2.0 - end.y)
        made[active[stops]] = waited(own[stops], (side * end.x)[stops], y[stops])
        sticks[active[stops]] = True
        goes = ~end.rests & ~stops
        active, side = active[goes], -side[goes]
        at, excess = -end.x[goes], -2.0 - end.y[goes]
        if not len(active):
            break
    return made, sticks


def waited(lanes: Lanes, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The error at breakaway after a stop at the error x and the excess -2 <= y <= 0."""
    v = np.asarray(lanes.drift)
    rate, bend = v + lanes.rho * x, lanes.rho * v
    back, ahead = rate**2 - 2.0 * bend * (y + 2.0), np.sqrt(rate**2 - 2.0 * bend * y)
    with np.errstate(all="ignore"):
        forward = np.where(rate > 0.0, -2.0 * y / (rate + ahead), (ahead - rate) / bend)
        backward = 2.0 * (y + 2.0) / (np.sqrt(np.maximum(back, 0.0)) - rate)
    return x + v * np.where((rate < 0.0) & (back >= 0.0), backward, forward)


def moving(loop: Loop, v: np.ndarray) -> Lanes:
    """A lane for each speed v in rad/s."""
    return replace(loop.lanes(len(v)), drift=v / (loop.unit * loop.wn))


def persisting(loop: Loop, v: np.ndarray, x: np.ndarray, rounds: int) -> np.ndarray:
    """An error at breakaway that follows so many others, units, at each speed; nan: none.

    ``x`` (n, count) are the first errors of each speed. Where a slow integral lets the error
    change alike from breakaway to breakaway, many of them are taken in one stride.
    """
    place, made = np.repeat(np.arange(len(v)), x.shape[1]), np.full(len(v), np.nan)
    lanes, x = moving(loop, v[place]), x.ravel()
    was, stride = np.full(len(x), np.nan), np.ones(len(x))
    for k in range(rounds):
        new, sticks = next_breakaway(lanes, x)
        change = new - x
        nearing = np.clip(np.nan_to_num((1.0 - change / was) / stride, nan=1.0), -1.0, 1.0)
        close = ALIKE * (np.abs(x) + np.asarray(lanes.drift)) * np.clip(nearing, SLOWEST, 1.0)
        repeats = sticks & (np.abs(change) <= close)
        made[place[repeats]] = new[repeats]
        goes = sticks & np.isnan(made[place])
        if k == 0:
            goes &= _some(place, new, goes)
        slow = np.abs(nearing) < SLOW
        stride = np.where(slow, STRIDE / np.maximum(np.abs(nearing), SLOWEST), 1.0)[goes]
        was = change[goes]
        lanes, place, x = lanes[goes], place[goes], x[goes] + stride * was
        if not len(x):
            break
    made[place] = x
    return made


def _some(place: np.ndarray, x: np.ndarray, among: np.ndarray) -> np.ndarray:
    """A few of the lanes at each speed, from the smallest error to the largest."""
    chosen = np.zeros(len(x), bool)
    for one in np.unique(place[among]):
        own = np.flatnonzero(among & (place == one))
        own = own[np.argsort(x[own])]
        chosen[own[np.linspace(0, len(own) - 1, FOLLOWED).astype(int)]] = True
    return chosen


def errors(loop: Loop, error: float, count: int = STARTS) -> np.ndarray:
    """Errors x at breakaway up to ``error``, units; without ki all breakaways are one, at 1."""
    x = np.geomspace(SMALLEST, max(error, 1.0), count // 2)
    return np.r_[-x, x] if loop.ki else np.ones(1)


def candidates(loop: Loop, v: np.ndarray, error: float) -> Iterator[tuple[float, float]]:
    """Speeds at which stick-slip goes on for a while, and an error at breakaway; highest first."""
    found = persisting(loop, v, np.tile(errors(loop, error), (len(v), 1)), BRIEF)
    for k in np.flatnonzero(np.isfinite(found))[::-1]:
        yield float(v[k]), float(found[k])


def followed(loop: Loop, v: np.ndarray, x: float) -> list[float | None]:
    """Where stick-slip from breakaway at x persists: the error at breakaway then."""
    found = persisting(loop, v, np.full((len(v), 1), x), ROUNDS)
    return [float(x) if np.isfinite(x) else None for x in found]
