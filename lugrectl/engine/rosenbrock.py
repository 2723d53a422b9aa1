"""One step of an L-stable Rosenbrock method, written out as expressions.

Four stages, three right-hand sides, order 4 with an embedded solution of order 3: the L-stable
set of Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.7, Table 7.2,
in the form without matrix products of the same section.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .graph import Graph, Node, derivatives, rename

GAMMA = 0.57282
STAGES = (  # weights of the earlier stages in the argument, time of the argument
    ((), 0.0),
    ((2.0,), 1.14564),
    ((1.867943637803922, 0.2344449711399156), 0.65521686381559),
    ((1.867943637803922, 0.2344449711399156), 0.65521686381559),
)
COUPLING = (
    (),
    (-7.137615036412310,),
    (2.580708087951457, 0.6515950076447975),
    (-2.137148994382534, -0.3214669691237626, -0.6949742501781779),
)
TIME_WEIGHTS = (0.57282, -1.769193891319233, 0.7592633437920482, -0.1049021087100450)
SOLUTION = (2.255570073418735, 0.2870493262186792, 0.4353179431840180, 1.093502252409163)
ERROR = (-0.2815431932141155, -0.07276199124938920, -0.1082196201495311, -1.093502252409163)


@dataclass(frozen=True, eq=False)
class Equations:
    """xdot(t, x, u) with nodes; ``slopes`` are du/dt, None for held inputs."""

    graph: Graph
    t: Node
    x: Sequence[Node]
    u: Sequence[Node]
    xdot: Sequence[Node]
    slopes: Sequence[Node] | None = None


def step(system: Equations, *, divided: bool = False) -> tuple[list[Node], list[Node]]:
    """The state after a step ``h`` and its error; ``divided`` by gamma h: fewer operations."""
    graph = system.graph
    h = graph.symbol("h")
    gh = h * GAMMA
    one = graph.constant(1.0)
    gain, unit = (one, 1.0 / gh) if divided else (gh, one)
    matrix = [  # I - gamma h J, or the same divided by gamma h
        [(unit if i == j else 0.0) - gain * entry for j, entry in enumerate(row)]
        for i, row in enumerate(zip(*(derivatives(system.xdot, x) for x in system.x), strict=True))
    ]
    lu = SparseLU(graph, matrix)
    drift = derivatives(system.xdot, system.t)  # also through changing inputs
    slopes = [] if system.slopes is None else list(zip(system.u, system.slopes, strict=True))
    for u, slope in slopes:
        drift = [a + b * slope for a, b in zip(drift, derivatives(system.xdot, u), strict=True)]
    rates, stages = list(system.xdot), []
    for number, ((weights, instant), coupling) in enumerate(zip(STAGES, COUPLING, strict=True)):
        if 0 < number < 3:  # the last stage shares its right-hand side with the one before
            state, later = _combine(system.x, weights, stages), h * instant
            to: dict[int, Node] = {x.index: new for x, new in zip(system.x, state, strict=True)}
            to |= {system.t.index: system.t + later}
            to |= {u.index: u + later * slope for u, slope in slopes}
            rates = rename(system.xdot, to)
        time_gain = gain * (h * TIME_WEIGHTS[number])
        couple = [unit * (GAMMA * c) for c in coupling]
        # known terms are added first: this shortens the longest chain of operations
        right = [
            gain * rate + (graph.total(_terms(couple, stages, i)) + time_gain * d)
            for i, (rate, d) in enumerate(zip(rates, drift, strict=True))
        ]
        stages.append(lu.solve(right))
    zero = [graph.constant(0.0)] * len(system.x)
    return _combine(system.x, SOLUTION, stages), _combine(zero, ERROR, stages)


def _terms(weights: Sequence[Any], stages: Sequence[Sequence[Node]], i: int) -> list[Node]:
    return [w * stage[i] for w, stage in zip(weights, stages, strict=False)]


def _combine(
    base: Sequence[Node], weights: Sequence[float], stages: Sequence[Sequence[Node]]
) -> list[Node]:
    return [b.graph.total([b, *_terms(weights, stages, i)]) for i, b in enumerate(base)]


class SparseLU:
    """Elimination of a matrix of nodes, with diagonal pivots in the order of least fill-in."""

    def __init__(self, graph: Graph, matrix: Sequence[Sequence[Node]]) -> None:
        self.graph = graph
        self.upper = {
            (i, j): entry
            for i, row in enumerate(matrix)
            for j, entry in enumerate(row)
            if not entry.is_constant(0.0)
        }
        self.lower: dict[tuple[int, int], Node] = {}
        self.inverse: dict[int, Node] = {}
        self.order: list[int] = []
        rest = set(range(len(matrix)))

        def fill(k: int) -> int:
            """Markowitz count: entries right of the pivot times entries below it."""
            row = sum((k, j) in self.upper for j in rest if j != k)
            return row * sum((i, k) in self.upper for i in rest if i != k)

        while rest:
            pivot = min(sorted(rest), key=fill)
            rest.remove(pivot)
            self.order.append(pivot)
            self.inverse[pivot] = 1.0 / self.upper[pivot, pivot]
            for i in [i for i in rest if (i, pivot) in self.upper]:
                factor = self.upper.pop((i, pivot)) * self.inverse[pivot]
                self.lower[i, pivot] = factor
                for j in [j for j in rest if (pivot, j) in self.upper]:
                    old = self.upper.get((i, j), self.graph.constant(0.0))
                    self.upper[i, j] = old - factor * self.upper[pivot, j]

    def solve(self, right: Sequence[Node]) -> list[Node]:
        value = dict(enumerate(right))
        for place, k in enumerate(self.order):
            for i in self.order[place + 1 :]:
                if (i, k) in self.lower:
                    value[i] = value[i] - self.lower[i, k] * value[k]
        for place, k in reversed([*enumerate(self.order)]):
            for j in self.order[place + 1 :]:
                if (k, j) in self.upper:
                    value[k] = value[k] - self.upper[k, j] * value[j]
            value[k] = value[k] * self.inverse[k]
        return [value[i] for i in range(len(right))]
