"""The method of steps: a run with dead times, segment by segment.

A segment is no longer than the shortest delay, so what a delay puts out in it was computed
before: on each panel between two edges a polynomial of degree 4, whose coefficients are held
inputs of the compiled code. Edges are the samples, the updates, and the times at which a delayed
signal has a jump or a kink. A panel on which a signal that will be delayed is not smooth enough is
halved, and its segment is run again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..expression.graph import Node, evaluate, rename
from ..tracing.equations import Program
from .delay_history import History, coefficients, joined, nodes, polynomial, roughness

SEGMENTS = 50_000  # of a run at most; a shorter delay stays an approximation
HALVINGS = 24  # rounds of them in a segment at most
SHORTEST = 1e-6  # of the shortest delay: a panel that is not halved


@dataclass(frozen=True)
class Piece:
    """Continuous states (n, 4 P + 1) at the nodes of P panels, and held values (k, P) in them."""

    x: np.ndarray
    held: np.ndarray


class Engine(Protocol):
    """What advances a system over a segment and says which signals will be delayed."""

    def advance(self, edges: np.ndarray, grid: np.ndarray, inputs: np.ndarray) -> Piece:
        """A segment from where the last accepted one ended."""
        ...

    def accept(self, edges: np.ndarray, piece: Piece) -> None: ...

    def sources(self, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The signals before their delays, (d, N)."""
        ...


@dataclass(frozen=True)
class Given:
    """The inputs of a run (m, N): values at the times, held or linear in between."""

    t: np.ndarray
    u: np.ndarray
    hold: bool

    def panels(self, edges: np.ndarray) -> np.ndarray:
        """Value and slope (2 m, P) at the start of each panel."""
        middle = 0.5 * (edges[:-1] + edges[1:])
        k = np.clip(np.searchsorted(self.t, middle, side="right") - 1, 0, len(self.t) - 2)
        slope = 0.0 * self.u[:, k]
        if not self.hold:
            slope = (self.u[:, k + 1] - self.u[:, k]) / (self.t[k + 1] - self.t[k])
        return np.vstack([self.u[:, k] + slope * (edges[:-1] - self.t[k]), slope])

    def at(self, k: Any) -> np.ndarray:
        return np.vstack([self.u[:, k], 0.0 * self.u[:, k]])


def lates(program: Program, p: np.ndarray) -> dict[int, float]:
    """The delay in s of each state that is a delayed signal."""
    late = program.graph.late
    names = {node.value: v for node, v in zip(program.p, p, strict=True)}
    places = {i: late[x.index] for i, x in enumerate(program.x) if x.index in late}
    return {
        i: float(evaluate([delay], names)[0]) if isinstance(delay, Node) else float(delay)
        for i, delay in places.items()
    }


def exact_states(
    program: Program, params: Mapping[str, Any] | None, t: np.ndarray
) -> tuple[int, ...]:
    """The delayed signals whose delay is not too short for the length of the run."""
    if not program.graph.late or len(t) < 2:
        return ()
    least, p = (t[-1] - t[0]) / SEGMENTS, program.arguments(params)
    return tuple(i for i, delay in lates(program, p).items() if delay > least)


def inputs_of(m: int, d: int) -> int:
    """The held inputs in place of m inputs and d delayed signals."""
    return 2 * m + 5 * d + 1


def by_time(
    program: Program, late: Sequence[int], m: int, roots: Sequence[Node]
) -> tuple[list[Node], list[Node]]:
    """Roots of time, and the held inputs: m values, m slopes, five coefficients of each delayed
    signal, and the start of the panel. The first rates of ``roots`` stay what they are."""
    graph = program.graph
    names = [graph.symbol(f"u{k}") for k in range(inputs_of(m, len(late)))]
    since = program.t - names[-1]
    to = {names[k].index: names[k] + names[m + k] * since for k in range(m)}
    for j, i in enumerate(late):
        rows = names[2 * m + 5 * j : 2 * m + 5 * j + 5]
        to[program.x[i].index] = polynomial(rows, since)
    return rename(roots, to), names


class Steps:
    """One run over the times ``given.t``."""

    def __init__(
        self, engine: Engine, given: Given, delays: Sequence[float], first: Any, rtol: float
    ) -> None:
        t = given.t
        self.engine, self.given, self.t, self.rtol = engine, given, t, rtol
        pairs = zip(first, delays, strict=True)
        self.past = [History(t[0], value, delay) for value, delay in pairs]
        self.longest, self.near = min(delays), 1e-10 * (t[-1] - t[0])
        self.breaks = [self._on_grid(t[0] + delay) for delay in delays]

    def all(self) -> np.ndarray:
        """The delayed signals (d, N) at the times, each just after the time."""
        now, late, done = float(self.t[0]), np.empty((len(self.past), len(self.t))), 0
        while now < self.t[-1]:
            edges = self._segment(self._edges(now))
            now = float(edges[-1])
            last = int(np.searchsorted(self.t, now, side="right"))
            for row, past in zip(late, self.past, strict=True):
                row[done:last] = past.late_from(self.t[done:last], self.longest)
            done = last
        return late

    def _edges(self, now: float) -> np.ndarray:
        """From now to the last edge that is not more than the shortest delay away."""
        reach = [now, now + self.longest + self.near]
        first, last = np.searchsorted(self.t, reach, side="right")
        soon = [b for b in self.breaks if now + self.near < b <= reach[1]]
        edges = joined([now, *self.t[first:last]], soon, self.near)
        if edges[-1] < now + 0.5 * self.longest and edges[-1] < self.t[-1]:
            edges = np.append(edges, self._on_grid(now + self.longest))
        self.breaks = [b for b in self.breaks if b > edges[-1] + self.near]
        return edges

    def _on_grid(self, t: float) -> float:
        """The time itself, or the sample that differs from it only by rounding."""
        k = int(np.searchsorted(self.t, t))
        near = [float(a) for a in self.t[max(k - 1, 0) : k + 1] if abs(a - t) <= self.near]
        return near[0] if near else t

    def _segment(self, edges: np.ndarray) -> np.ndarray:
        """Run a segment, in panels on which all delayed signals are smooth; its edges."""
        for again in range(HALVINGS + 1):
            columns, rough = self._columns(edges)
            if not rough.any() or again == HALVINGS:
                inputs = np.append(np.repeat(columns, 4, axis=1), self._last(edges), axis=1)
                grid = np.append(nodes(edges)[:, :-1].ravel(), edges[-1])
                piece = self.engine.advance(edges, grid, inputs)
                values = self._sources(edges, columns, piece)
                rough = self._rough(edges, values, 10.0, growing=True)
                if not rough.any() or again == HALVINGS:
                    self._accept(edges, values, piece)
                    return edges
            edges = np.sort(np.append(edges, 0.5 * (edges[:-1] + edges[1:])[rough]))
        raise AssertionError("unreachable")

    def _columns(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The held inputs (2 m + 5 d + 1, P) of panels, and which of them are not smooth."""
        values = np.array([past.late(edges) for past in self.past])
        rows = [coefficients(own, np.diff(edges)).T for own in values]
        made = np.vstack([self.given.panels(edges), *rows, edges[None, :-1]])
        return made, self._rough(edges, values, 20.0, growing=False)

    def _last(self, edges: np.ndarray) -> np.ndarray:
        """The held inputs just after the last edge."""
        k = int(np.searchsorted(self.t, edges[-1], side="right")) - 1
        row = self.given.at([k])
        if self.t[k] < edges[-1] and not self.given.hold:
            row = self.given.panels(edges[-1] + self.longest * np.array([0.0, 1e-3]))
        end = edges[-1:]
        late = [[[*past.late_from(end, self.longest), 0, 0, 0, 0]] for past in self.past]
        return np.vstack([row, *(np.transpose(c) for c in late), end[:, None]])

    def _rough(
        self, edges: np.ndarray, values: np.ndarray, factor: float, *, growing: bool
    ) -> np.ndarray:
        rough = np.zeros(len(edges) - 1, dtype=bool)
        for past, own in zip(self.past, values, strict=True):
            size = max(past.size, float(np.max(np.abs(own)))) if growing else past.size
            rough |= roughness(own) > factor * self.rtol * size
        return rough & (np.diff(edges) > SHORTEST * self.longest)

    def _sources(self, edges: np.ndarray, columns: np.ndarray, piece: Piece) -> np.ndarray:
        """What will be delayed, at the nodes of the panels, (d, P, 5)."""
        many = len(edges) - 1
        at = np.arange(5) + 4 * np.arange(many)[:, None]
        u = np.repeat(np.vstack([columns, piece.held]), 5, axis=1)
        found = self.engine.sources(nodes(edges).ravel(), piece.x[:, at.ravel()], u)
        return found.reshape(-1, many, 5)

    def _accept(self, edges: np.ndarray, values: np.ndarray, piece: Piece) -> None:
        for past, own in zip(self.past, values, strict=True):
            self.breaks += map(self._on_grid, past.extend(edges, own, self.rtol))
        self.engine.accept(edges, piece)


def held_at(given: Given, late: np.ndarray) -> np.ndarray:
    """The held inputs at the times themselves."""
    rows = [np.vstack([row, np.zeros((4, len(row)))]) for row in late]
    return np.vstack([given.at(slice(None)), *rows, given.t])


def with_late(x: np.ndarray, places: Mapping[int, np.ndarray]) -> np.ndarray:
    """The states, with the delayed signals in place of the states of their approximations."""
    for i, row in places.items():
        x[i], x[i + 1] = row, 0.0
    return x
