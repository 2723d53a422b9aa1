"""A search by simulation, for loops whose state in a stick is no number: what persists from many
starts, and the smallest that does not come to rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import NamedTuple

import numpy as np

from ..core.display import number
from ..core.errors import Diverged
from .gains import edge
from .result import Cycle, LimitCycles

RESTS, HUNTS, GROWS, OPEN = "rests", "hunts", "grows", "open"
JOINS = "joins"  # a motion that is known to go on
AWAKE = (HUNTS, GROWS, JOINS)
VERBS = {
    RESTS: "came to rest",
    HUNTS: "kept swinging",
    GROWS: "grew without bound",
    OPEN: "stayed undecided",
}
STILL = 1e-6  # of its largest value, by which the torque of a drive at rest still moves
TINY = 1e-6  # of its largest error, by which a drive at rest still creeps
STEADY = 0.05  # relative change of a size that persists
REPEATS = 1e-3  # the same of a mean of half turns, which repeats; or four errors of that mean
TURNS = 6  # half turns in the last third, at least
MANY = 300  # the same of a motion that scatters: it may come to rest by chance
SAME = 0.1  # relative difference of two amplitudes that are one, or twice their scatter
SMALLER = 0.1  # of the smallest start: an error that has come to rest
LARGER = 1e3  # times the largest start: an error that grows
BORDER = 1.05  # ratio of the two starts between which a border lies
LENGTHS = (1, 4, 16, 64)  # how many times its first length a run may take


class Motion(NamedTuple):
    """Times, the error of the side that is controlled, the torque; theta by side where there are
    a motor and a load."""

    t: np.ndarray
    e: np.ndarray
    u: np.ndarray
    sides: dict[str, np.ndarray] = {}


Run = Callable[[float, int], Motion]  # from a start, for so many times its first length


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


def judged(m: Motion, small: float, large: float) -> Seen:
    """Judge by the last thirds of a motion; an error below ``small`` rests, one beyond ``large``
    that rises grows."""
    third = len(m.t) // 3
    before, now = (slice(k * third, (k + 1) * third) for k in (1, 2))
    last, earlier = (float(np.abs(m.e[part]).max()) for part in (now, before))
    creeps, moves = TINY * np.abs(m.e).max(), STILL * np.abs(m.u).max()
    if np.ptp(m.e[now]) <= creeps and np.ptp(m.u[now]) <= moves:
        return Seen(RESTS)
    if (seen := _repeating(m, before, now)) is not None:
        return seen
    if last <= small:
        return Seen(RESTS)
    return Seen(GROWS if last > max(large, earlier) else OPEN, size=last, ratio=last / earlier)


def _repeating(m: Motion, before: slice, now: slice) -> Seen | None:
    size, was = np.ptp(m.e[now]), np.ptp(m.e[before])
    peaks, times = _half_turns(m.t[now], m.e[now])
    if len(peaks) < TURNS or abs(size - was) > STEADY * was:
        return None
    size, scatter = float(peaks.mean()), float(peaks.std())
    drift = abs(size / _half_turns(m.t[before], m.e[before])[0].mean() - 1.0)
    if drift > max(REPEATS, 4.0 * scatter / size / np.sqrt(len(peaks))):
        return None
    sides = {k: float(_half_turns(m.t[now], y[now])[0].mean()) for k, y in m.sides.items()}
    sure = scatter <= REPEATS * size or len(peaks) >= MANY
    period = 2.0 * float(np.diff(times).mean())
    return Seen(HUNTS, size, scatter, period, sides, size, sure=sure)


def _half_turns(t: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest |e| between sign changes about the middle of the motion, and their times."""
    own = e - 0.5 * (e.max() + e.min())
    far = np.abs(own) > 0.25 * own.max()  # a stop near the middle is no turn
    sign, at = np.sign(own[far]), np.flatnonzero(far)
    turned = at[1:][sign[1:] != sign[:-1]]
    parts = zip(turned[:-1], turned[1:], strict=True)
    return np.array([np.abs(own[a:b]).max() for a, b in parts]), t[turned]


def cycles_of(seen: Iterable[Seen]) -> tuple[Cycle, ...]:
    """Return the different cycles among what persists, each the mean of its starts."""
    made: list[list[Seen]] = []
    for one in sorted((s for s in seen if s.fate == HUNTS), key=lambda s: s.amplitude):
        last = made[-1][-1] if made else one
        far = one.amplitude - last.amplitude > max(SAME * last.amplitude, 2.0 * last.scatter)
        made += [[]] if far or not made else []
        made[-1].append(one)
    return tuple(_mean(group) for group in made)


def _mean(group: list[Seen]) -> Cycle:
    rows = [(s.amplitude, s.period, s.scatter, *s.sides.values()) for s in group]
    size, period, scatter, *sides = np.mean(rows, axis=0).tolist()
    return Cycle(size, period, True, (), None, scatter, *sides)


@dataclass(frozen=True)
class Budget:
    """What is not known at the time ``end`` stays open."""

    end: float
    report: Callable[[float, str], None]

    def is_over(self) -> bool:
        return monotonic() > self.end


class Search:
    """Runs from several starts, each as long as it needs within a budget of simulated time.

    A motion that swings as large as one that is known to go on, or that such a one has passed, goes
    on like it; that a motion rests is seen of each by itself.
    """

    def __init__(self, run: Run, starts: Iterable[float], budget: Budget) -> None:
        self.run, self.starts, self.budget = run, sorted(map(float, starts)), budget
        self.small, self.large = SMALLER * self.starts[0], LARGER * self.starts[-1]
        self.passed: list[tuple[float, float]] = []
        self.sure: list[Seen] = []

    def answer(self, where: str) -> LimitCycles:
        """Cycles and border; ``where`` it starts, with {} for the smallest and the largest."""
        count, falling = len(self.starts), []
        for k, start in enumerate(reversed(self.starts)):
            self.budget.report(k / count, f"start {k + 1} of {count}")
            falling.append(self._fate(start))
        seen = self._settled(falling[::-1])
        ends = where.format(*map(number, (self.starts[0], self.starts[-1])))
        grows, undecided = (sum(s.fate == fate for s in seen) for fate in (GROWS, OPEN))
        basin, said = self._border(seen), (_words(seen, ends),)
        return LimitCycles(cycles_of(seen), basin, None, bool(grows), {}, said, undecided=undecided)

    def _fate(self, start: float) -> Seen:
        one = Seen(OPEN)
        for length in LENGTHS:
            if self.budget.is_over():
                return Seen(OPEN)
            try:
                one = judged(self.run(start, length), self.small, self.large)
            except Diverged:
                one = Seen(GROWS)
            if one.fate == OPEN and self._joins(one):
                one = one._replace(fate=JOINS)
            if one.fate != OPEN and (one.sure or self._known(one)):
                break
        if one.fate in AWAKE:
            self.passed.append((min(start, one.size), max(start, one.size)))
            self.sure += [one] * (one.fate == HUNTS)
        return one

    def _known(self, one: Seen) -> bool:
        """Whether one that scatters as it does has been seen for long."""
        return any(abs(one.size - s.size) <= 2.0 * s.scatter for s in self.sure)

    def _joins(self, one: Seen) -> bool:
        """Whether it changes, so that it is near no cycle of its own, where another goes on."""
        return abs(one.ratio - 1.0) > STEADY and any(a <= one.size <= b for a, b in self.passed)

    def _settled(self, seen: Sequence[Seen]) -> list[Seen]:
        """What still shrinks at the end of the budget, below starts that all rest, rests too."""
        resting, all_rest, made = 0.0, True, []
        for start, one in zip(self.starts, seen, strict=True):
            if one.fate == OPEN and one.ratio < 1.0 and one.size < resting:
                one = Seen(RESTS)
            all_rest = all_rest and one.fate == RESTS
            resting = start if all_rest else resting
            made.append(one)
        return made

    def _border(self, seen: Sequence[Seen]) -> float | None:
        """The smallest start that does not come to rest; 0 where it is the first."""
        first = next((k for k, s in enumerate(seen) if s.fate in AWAKE), None)
        if not first:
            return first
        low, high = self.starts[first - 1 : first + 1]

        def sleeps(start: float) -> bool:
            return self._fate(start).fate not in AWAKE

        return edge(sleeps, low, high, BORDER, self.budget.is_over)[1]


def _words(seen: Sequence[Seen], where: str) -> str:
    """What was searched, and what became of the starts."""
    fates = [HUNTS if s.fate == JOINS else s.fate for s in seen]
    every = ", ".join(f"{fates.count(k)} {verb}" for k, verb in VERBS.items() if k in fates)
    return f"searched by simulation from {len(seen)} starts, {where}, not proven: {every}"
