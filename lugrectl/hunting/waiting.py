"""Whether a motion that was simulated persists: for loops whose state in a stick is no number."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from ..core.errors import Diverged
from .result import Cycle

RESTS, HUNTS, GROWS, OPEN = "rests", "hunts", "grows", "open"
STILL = 1e-6  # of its range, by which the torque of a drive at rest still moves
SHRINKS = 0.9  # of its size a third before: a motion that comes to rest
STEADY = 0.05  # relative change of a size that persists
REPEATS = 1e-3  # the same of a mean of half turns, which repeats; or four errors of that mean
TURNS = 6  # half turns in the last third, at least
SAME = 0.1  # relative difference of two amplitudes that are one, or twice their scatter
TINY = 1e-9  # of the start: rounding


class Seen(NamedTuple):
    """What became of a start: amplitude, its scatter, and the period."""

    fate: str
    amplitude: float = 0.0
    scatter: float = 0.0
    period: float = np.inf


def judged(t: np.ndarray, e: np.ndarray, u: np.ndarray, last: bool) -> Seen:
    """What the last thirds of a motion say; ``last``: nothing longer follows."""
    third = len(t) // 3
    before, now = (slice(k * third, (k + 1) * third) for k in (1, 2))
    size, was, all_of = np.ptp(e[now]), np.ptp(e[before]), np.ptp(e)
    moved = np.ptp(u[now])
    if size <= TINY * all_of and moved <= STILL * np.ptp(u):
        return Seen(RESTS)
    peaks, times = half_turns(t[now], e[now])
    if len(peaks) >= TURNS and abs(size - was) <= STEADY * was:
        drift = abs(peaks.mean() / half_turns(t[before], e[before])[0].mean() - 1.0)
        if drift <= max(REPEATS, 4.0 * peaks.std() / peaks.mean() / np.sqrt(len(peaks))):
            return Seen(HUNTS, peaks.mean(), peaks.std(), 2.0 * np.diff(times).mean())
    if not last:
        return Seen(OPEN)
    if size > was / SHRINKS and size > all_of * SHRINKS:
        return Seen(GROWS)
    shrinks = size < SHRINKS * was or moved < SHRINKS * np.ptp(u[before])
    return Seen(RESTS if shrinks else OPEN)


def half_turns(t: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest |e| between sign changes about the middle of the motion, and their times."""
    own = e - 0.5 * (e.max() + e.min())
    far = np.abs(own) > 0.25 * own.max()  # a stop near the middle is no turn
    sign, at = np.sign(own[far]), np.flatnonzero(far)
    turned = at[1:][sign[1:] != sign[:-1]]
    parts = zip(turned[:-1], turned[1:], strict=True)
    return np.array([np.abs(own[a:b]).max() for a, b in parts]), t[turned]


Run = Callable[[float, int], tuple[np.ndarray, np.ndarray, np.ndarray]]


def watched(run: Run, starts: Iterable[float], lengths: tuple[int, ...]) -> list[Seen]:
    """What became of each start; a run takes a start and a length, and is longer where open."""
    seen = []
    for start in starts:
        for length in lengths:
            try:
                one = judged(*run(start, length), length == lengths[-1])
            except Diverged:
                one = Seen(GROWS)
            if one.fate != OPEN:
                break
        seen.append(one)
    return seen


def cycles_of(seen: Iterable[Seen]) -> list[Cycle]:
    """The different cycles among what persists, each the mean of its starts."""
    made: list[list[Seen]] = []
    for one in sorted((s for s in seen if s.fate == HUNTS), key=lambda s: s.amplitude):
        last = made[-1][-1] if made else one
        far = one.amplitude - last.amplitude > max(SAME * last.amplitude, 2.0 * last.scatter)
        made += [[]] if far or not made else []
        made[-1].append(one)
    means = [np.mean([s[1:] for s in group], axis=0).tolist() for group in made]
    return [Cycle(size, period, True, scatter=scatter) for size, scatter, period in means]
