"""Where a function of frequency changes its sign, as far as rounding can tell.

A computed zero of the function is a point at which its value is a rounding error: it says nothing
of the sign. So changes are looked for between points whose value exceeds its rounding bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

SHARP = 1e-6  # relative distance of the two sides of an edge that counts as none
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
    """The signs ``above`` at the points ``at`` where they are sure, and the ``edges`` between."""

    at: np.ndarray
    above: np.ndarray
    edges: tuple[Edge, ...]

    @classmethod
    def of(cls, function: Function, points: Any, values: Any = None) -> SureSigns:
        """``points`` (n,) ascend; ``values`` (n, 2) are those there, where they are known."""
        made = np.array([function(x) for x in points] if values is None else values)
        sure = np.abs(made[:, 0]) > made[:, 1]
        at, above = np.asarray(points)[sure], made[sure, 0] > 0
        turns = np.flatnonzero(above[1:] != above[:-1])
        return cls(at, above, tuple(edge(function, *at[k : k + 2].tolist()) for k in turns))

    def moved(self, to: Map) -> SureSigns:
        """The same in another variable."""
        return replace(self, at=np.array([*map(to, self.at)]),
                       edges=tuple(e.moved(to) for e in self.edges))  # fmt: skip

    def below_beyond(self) -> SureSigns:
        """The same of a function that is below 0 as the frequency grows without end."""
        if len(self.above) and not self.above[-1]:
            return self
        last = float(self.at[-1]) if len(self.at) else 0.0
        edges = (*self.edges, Edge(last, last, math.inf)) if len(self.at) else ()
        return SureSigns(np.append(self.at, math.inf), np.append(self.above, False), edges)

    def first_band(self) -> tuple[Edge, Edge | None, int]:
        """Where it is below 0 first: from, to (None: without end), and how often again later."""
        starts = self.edges if self.above[0] else (Edge(0.0, 0.0, 0.0), *self.edges)
        return starts[0], starts[1] if len(starts) > 1 else None, (len(starts) - 1) // 2


def edge(function: Function, a: float, b: float) -> Edge:
    """The change of sign between two points with different, sure signs."""
    found: Any = brentq(lambda x: function(x)[0], a, b, xtol=1e-300, rtol=np.float64(1e-13))
    at = float(found)
    return Edge(at, beside(function, at, a), beside(function, at, b))


def beside(function: Function, at: float, end: float) -> float:
    """The nearest point on the way from an edge to ``end`` that has, surely, the sign there."""
    sign = math.copysign(1.0, function(end)[0])
    step = NEAREST * abs(at)
    while step < abs(end - at):
        x = at + math.copysign(step, end - at)
        value, slack = function(x)
        if sign * value > slack:
            return x
        step *= FURTHER
    return end
