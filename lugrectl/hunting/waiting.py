"""What becomes of a motion that is simulated: for loops whose state in a stick is no number."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from .result import Cycle

RESTS, HUNTS, GROWS, OPEN = "rests", "hunts", "grows", "open"
STILL = 1e-6  # of its largest value, by which the torque of a drive at rest still moves
TINY = 1e-6  # of its largest error, by which a drive at rest still creeps
STEADY = 0.05  # relative change of a size that persists
REPEATS = 1e-3  # the same of a mean of half turns, which repeats; or four errors of that mean
TURNS = 6  # half turns in the last third, at least
MANY = 300  # the same of a motion that scatters: it may come to rest by chance
SAME = 0.1  # relative difference of two amplitudes that are one, or twice their scatter


class Motion(NamedTuple):
    """Times, the error of the side that is controlled, the torque; theta by side where there are
    a motor and a load."""

    t: np.ndarray
    e: np.ndarray
    u: np.ndarray
    sides: dict[str, np.ndarray] = {}


class Seen(NamedTuple):
    """What became of a start: amplitude, its scatter, the period, and the amplitude by side.

    ``sure``: it repeats, or has scattered for many turns.
    ``size`` is the largest error in the last third of what was seen, ``ratio`` that to the third
    before.
    """

    fate: str
    amplitude: float = 0.0
    scatter: float = 0.0
    period: float = np.inf
    sides: dict[str, float] = {}
    size: float = np.inf
    ratio: float = 1.0
    sure: bool = True


Run = Callable[[float, int], Motion]


def judged(m: Motion, small: float, large: float) -> Seen:
    """What the last thirds of a motion say; an error below ``small`` rests, one beyond ``large``
    that rises grows."""
    third = len(m.t) // 3
    before, now = (slice(k * third, (k + 1) * third) for k in (1, 2))
    last, earlier = (float(np.abs(m.e[part]).max()) for part in (now, before))
    creeps, moves = TINY * np.abs(m.e).max(), STILL * np.abs(m.u).max()
    still = np.ptp(m.e[now]) <= creeps and np.ptp(m.u[now]) <= moves
    if still:
        return Seen(RESTS)
    if (seen := _repeating(m, before, now)) is not None:
        return seen
    if last <= small:
        return Seen(RESTS)
    return Seen(GROWS if last > max(large, earlier) else OPEN, size=last, ratio=last / earlier)


def _repeating(m: Motion, before: slice, now: slice) -> Seen | None:
    size, was = np.ptp(m.e[now]), np.ptp(m.e[before])
    peaks, times = half_turns(m.t[now], m.e[now])
    if len(peaks) < TURNS or abs(size - was) > STEADY * was:
        return None
    drift = abs(peaks.mean() / half_turns(m.t[before], m.e[before])[0].mean() - 1.0)
    if drift > max(REPEATS, 4.0 * peaks.std() / peaks.mean() / np.sqrt(len(peaks))):
        return None
    sides = {k: float(half_turns(m.t[now], y[now])[0].mean()) for k, y in m.sides.items()}
    period = 2.0 * float(np.diff(times).mean())
    size, scatter = float(peaks.mean()), float(peaks.std())
    sure = scatter <= REPEATS * size or len(peaks) >= MANY
    return Seen(HUNTS, size, scatter, period, sides, size, sure=sure)


def half_turns(t: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest |e| between sign changes about the middle of the motion, and their times."""
    own = e - 0.5 * (e.max() + e.min())
    far = np.abs(own) > 0.25 * own.max()  # a stop near the middle is no turn
    sign, at = np.sign(own[far]), np.flatnonzero(far)
    turned = at[1:][sign[1:] != sign[:-1]]
    parts = zip(turned[:-1], turned[1:], strict=True)
    return np.array([np.abs(own[a:b]).max() for a, b in parts]), t[turned]


def cycles_of(seen: Iterable[Seen]) -> list[Cycle]:
    """The different cycles among what persists, each the mean of its starts."""
    made: list[list[Seen]] = []
    for one in sorted((s for s in seen if s.fate == HUNTS), key=lambda s: s.amplitude):
        last = made[-1][-1] if made else one
        far = one.amplitude - last.amplitude > max(SAME * last.amplitude, 2.0 * last.scatter)
        made += [[]] if far or not made else []
        made[-1].append(one)
    return [_mean(group) for group in made]


def _mean(group: list[Seen]) -> Cycle:
    rows = [(s.amplitude, s.period, s.scatter, *s.sides.values()) for s in group]
    size, period, scatter, *sides = np.mean(rows, axis=0).tolist()
    motor, load = sides or (None, None)
    return Cycle(size, period, True, (), None, scatter, motor, load)
