"""Where a function of frequency changes its sign, as far as rounding can tell.

A computed zero of the function is a point at which its value is a rounding error: it says nothing
of the sign. So changes are looked for between points whose value exceeds its rounding bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

SHARP = 1e-6  # relative distance of the two sides of an edge that counts as none
HALVINGS = 40
NEAREST, FURTHER = 1e-13, 2.0  # of an edge: the first point beside it, and the next ones

Function = Callable[[float], tuple[float, float]]  # value and rounding bound at a frequency
Map = Callable[[float], float]


class Edge(NamedTuple):
    """A change of sign at ``at``; at ``low`` and ``high``, beside it, the sign is sure."""

    at: float
    low: float
    high: float

    @property
    def sharp(self) -> bool:
        return math.isfinite(self.high) and self.high - self.low <= SHARP * self.high

    @property
    def first(self) -> float:
        """Up to where nothing changes: the edge, or the last sure point before a blurred one."""
        return self.at if self.sharp else self.low

    def moved(self, to: Map) -> Edge:
        """The same in another variable."""
        return Edge(*map(to, self))

    def __str__(self) -> str:
        if self.sharp:
            return f"{self.at:.6g}"
        return f"(between {self.low:.9g} and {self.high:.9g}: rounding decides)"


@dataclass(frozen=True)
class SureSigns:
    """The signs ``above`` at the points ``at`` where they are sure, and the ``edges`` between.

    ``touches``: where the function is 0 within rounding between points of one sign, or at an end.
    """

    at: np.ndarray
    above: np.ndarray
    edges: tuple[Edge, ...]
    touches: tuple[Edge, ...] = ()

    @classmethod
    def of(cls, function: Function, points: Any, values: Any = None) -> SureSigns:
        """``points`` (n,) ascend; ``values`` (n, 2) are those there, where they are known."""
        made = np.array([function(x) for x in points] if values is None else values)
        x, sure = np.asarray(points), np.flatnonzero(np.abs(made[:, 0]) > made[:, 1])
        at, above = x[sure], made[sure, 0] > 0
        turns = np.flatnonzero(above[1:] != above[:-1])
        edges = tuple(edge(function, *at[k : k + 2].tolist()) for k in turns)
        return cls(at, above, edges, tuple(_touches(function, x, sure, above)))

    def moved(self, to: Map) -> SureSigns:
        """The same in another variable."""
        edges, touches = (tuple(e.moved(to) for e in part) for part in (self.edges, self.touches))
        return SureSigns(np.array([*map(to, self.at)]), self.above, edges, touches)

    def below_beyond(self) -> SureSigns:
        """The same of a function that is below 0 as the frequency grows without end."""
        if len(self.above) and not self.above[-1]:
            return self
        last = float(self.at[-1]) if len(self.at) else 0.0
        edges = (*self.edges, Edge(last, last, math.inf)) if len(self.at) else ()
        at, above = np.append(self.at, math.inf), np.append(self.above, False)
        return SureSigns(at, above, edges, self.touches)

    def first_band(self) -> tuple[Edge, Edge | None, int]:
        """Where it is below 0 first: from, to (None: without end), and how often again later."""
        starts = self.edges if self.above[0] else (Edge(0.0, 0.0, 0.0), *self.edges)
        return starts[0], starts[1] if len(starts) > 1 else None, (len(starts) - 1) // 2


def _touches(
    function: Function, x: np.ndarray, sure: np.ndarray, above: np.ndarray
) -> Iterator[Edge]:
    """The stretches of points without a sure sign, not those in which it changes."""
    ends = [-1, *sure.tolist(), len(x)]
    for i, (k, m) in enumerate(pairwise(ends)):
        inner = 0 < i < len(sure)
        if m == k + 1 or (inner and above[i] != above[i - 1]):
            continue
        low, high = float(x[k + 1]), float(x[m - 1])
        at = 0.5 * (low + high)
        low = beside(function, low, float(x[k])) if k >= 0 else low
        yield Edge(at, low, beside(function, high, float(x[m])) if m < len(x) else high)


def edge(function: Function, a: float, b: float) -> Edge:
    """The change of sign between two points with different, sure signs."""
    found: Any = brentq(lambda x: function(x)[0], a, b, xtol=1e-300, rtol=np.float64(1e-13))
    at = float(found)
    return Edge(at, beside(function, at, a), beside(function, at, b))


def beside(function: Function, at: float, end: float) -> float:
    """The nearest point on the way from an edge to ``end`` that has, surely, the sign there."""
    sign = math.copysign(1.0, function(end)[0])
    step = NEAREST * (abs(at) or abs(end))
    while step < abs(end - at):
        x = at + math.copysign(step, end - at)
        value, slack = function(x)
        if sign * value > slack:
            return x
        step *= FURTHER
    return end


def last_that_holds(holds: Callable[[float], bool], high: float) -> float:
    """The largest value up to ``high`` for which it holds, as for all smaller ones; bisection."""
    if holds(high * (1 - 1e-12)):
        return high
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
