"""A probability from a number of members, and a bound that so many of them give."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import count as numbers
from typing import Any

import numpy as np
from scipy import stats

from ..core.display import Row, Shown
from .standstill import HUNTS, UNDECIDED

SURE = 0.95  # of a bound, and of the interval of a probability


@dataclass(frozen=True, repr=False)
class Chance(Shown):
    """``count`` of ``members`` had a property: ``.value``, and ``.ci95`` by Clopper and Pearson."""

    count: int
    members: int

    @property
    def value(self) -> float:
        return self.count / self.members

    @property
    def ci95(self) -> tuple[float, float]:
        k, n, tail = self.count, self.members, (1.0 - SURE) / 2.0
        low = float(stats.beta.ppf(tail, k, n - k + 1)) if k else 0.0
        return low, float(stats.beta.ppf(1.0 - tail, k + 1, n - k)) if k < n else 1.0

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return {"value": self.value, "ci95": list(self.ci95), "count": self.count,
                "members": self.members}  # fmt: skip

    def words(self) -> str:
        low, high = (100.0 * x for x in self.ci95)
        ends = f"95 % from {low:.2g} to {high:.2g} %, {self.members} members"
        return f"{100.0 * self.value:.3g} % ({ends})"

    def _title(self) -> str:
        return self.words()

    def _rows(self) -> Iterable[Row]:
        return ()


@dataclass(frozen=True, repr=False)
class Outcomes(Chance):
    """The chance of hunting, with the members of which nothing was decided: ``.value`` is the share
    that hunts, ``.rests`` and ``.unsure`` are the others."""

    undecided: int = 0

    @classmethod
    def of(cls, fates: Sequence[float] | np.ndarray) -> Outcomes:
        """From the fate of each member."""
        hunting, open_ = (int(np.sum(np.equal(fates, one))) for one in (HUNTS, UNDECIDED))
        return cls(hunting, len(fates), open_)

    @property
    def unsure(self) -> float:
        return self.undecided / self.members

    @property
    def rests(self) -> float:
        return 1.0 - self.value - self.unsure

    def summary(self) -> dict[str, Any]:
        """Plain Python, with the three shares."""
        shares = {"hunts": self.value, "rests": self.rests, "undecided": self.unsure}
        return super().summary() | {"shares": shares}

    def words(self) -> str:
        more = f"; undecided {100.0 * self.unsure:.3g} %" if self.undecided else ""
        return super().words() + more


def hunting_at_most(members: int, part: float) -> int:
    """How many of them may hunt so that the interval of the chance ends at ``part``; -1 where they
    are too few. 0 of n ends near 3.7/n, so that it takes 72 drives for 0.05; all for 1."""
    if part == 1.0:
        return members
    counts = np.arange(members)
    ends = stats.beta.ppf(0.5 * (1.0 + SURE), counts + 1, members - counts)
    return int(np.searchsorted(ends, part, "right")) - 1


def spared(members: int, confidence: float) -> int:
    """How many members may lie beyond a bound that a new one keeps with ``confidence``: the
    largest k with P(Bin(members, 1 - confidence) <= k) <= 1 - SURE; -1 where they are too few."""
    return int(np.searchsorted(
        stats.binom.cdf(np.arange(members + 1), members, 1.0 - confidence), 1.0 - SURE, "right"
    )) - 1  # fmt: skip


def enough(confidence: float, spare: int = 1) -> int:
    """The fewest members of which so many may lie beyond the bound."""
    return next(n for n in numbers(spare + 1) if spared(n, confidence) >= spare)


def enough_at_rest(part: float, spare: int = 0) -> int:
    """The fewest members that show that at most this part of all drives hunts, though so many of
    them do."""
    return next(n for n in numbers(1) if hunting_at_most(n, part) >= spare)


def bound(values: np.ndarray, confidence: float) -> float:
    """What a new member's value is below with ``confidence``, itself sure to 95 %."""
    k = spared(len(values), confidence)
    return float(np.sort(values)[-1 - k]) if k >= 0 else np.inf


def band(values: np.ndarray, level: float = SURE) -> tuple[float, float]:
    """The interval in which a new member lies with this probability, by the order of the others:
    below the k-th of n with k/(n + 1)."""
    ordered, last, tail = np.sort(values), len(values) - 1, 0.5 * (1.0 - level)
    low = max(tail * (last + 2) - 1.0, 0.0)
    return between(ordered, low), between(ordered, last - low)


def between(values: np.ndarray, place: float) -> float:
    """Return a quantile; infinite beside an infinite value."""
    low, high = values[math.floor(place)], values[math.ceil(place)]
    if not math.isfinite(high):
        return math.inf if place > math.floor(place) else float(low)
    return float(low + (place - math.floor(place)) * (high - low))
