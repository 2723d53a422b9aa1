"""A search by simulation: what persists from many starts, and the smallest that does not rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from time import monotonic

import numpy as np

from ..core.display import number
from ..core.errors import Diverged
from .rigid import Answer
from .waiting import GROWS, HUNTS, OPEN, RESTS, STEADY, Run, Seen, cycles_of, judged

SMALLER = 0.1  # of the smallest start: an error that has come to rest
LARGER = 1e3  # times the largest start: an error that grows
BORDER = 1.05  # ratio of the two starts between which a border lies
JOINS = "joins"  # a motion that is known to go on
AWAKE = (HUNTS, GROWS, JOINS)
VERBS = {
    RESTS: "came to rest",
    HUNTS: "kept swinging",
    GROWS: "grew without bound",
    OPEN: "stayed undecided",
}


class Search:
    """Runs from several starts, each as long as it needs within a budget of simulated time.

    ``lengths``: how many times its first length a run may take. What is not known at the time
    ``end`` stays open. A motion that swings as large as one that is known to go on, or
    that such a one has passed, goes on like it; that a motion rests is seen of each by itself.
    """

    def __init__(
        self,
        run: Run,
        starts: Iterable[float],
        lengths: Sequence[int],
        end: float = np.inf,
        report: Callable[[float, str], None] = lambda share, what: None,
    ) -> None:
        self.run, self.starts = run, sorted(map(float, starts))
        self.lengths, self.report = lengths, report
        self.end = end
        self.small, self.large = SMALLER * self.starts[0], LARGER * self.starts[-1]
        self.passed: list[tuple[float, float]] = []
        self.sure: list[Seen] = []

    def answer(self, where: str) -> Answer:
        """Cycles and border; ``where`` it starts, with {} for the smallest and the largest."""
        count, falling = len(self.starts), []
        for k, start in enumerate(reversed(self.starts)):
            self.report(k / count, f"start {k + 1} of {count}")
            falling.append(self._fate(start))
        seen = self._settled(falling[::-1])
        ends = where.format(*map(number, (self.starts[0], self.starts[-1])))
        return Answer(
            cycles_of(seen),
            self._border(seen),
            None,
            any(s.fate == GROWS for s in seen),
            [_words(seen, ends)],
            None,
            sum(s.fate == OPEN for s in seen),
        )

    def _fate(self, start: float) -> Seen:
        one = Seen(OPEN)
        for length in self.lengths:
            if monotonic() > self.end:
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
        awake = [k for k, s in enumerate(seen) if s.fate in AWAKE]
        if not awake:
            return None
        if awake[0] == 0:
            return 0.0
        low, high = self.starts[awake[0] - 1], self.starts[awake[0]]
        while high > BORDER * low and monotonic() < self.end:
            middle = float(np.sqrt(low * high))
            awakes = self._fate(middle).fate in AWAKE
            low, high = (low, middle) if awakes else (middle, high)
        return high


def _words(seen: Sequence[Seen], where: str) -> str:
    """What was searched, and what became of the starts."""
    fates = [HUNTS if s.fate == JOINS else s.fate for s in seen]
    parts = [f"{fates.count(k)} {verb}" for k, verb in VERBS.items() if k in fates]
    every = ", ".join(parts)
    return f"searched by simulation from {len(seen)} starts, {where}, not proven: {every}"
