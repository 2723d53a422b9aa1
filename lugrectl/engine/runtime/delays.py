"""Exact dead times by the method of steps: a run segment by segment.

A segment is no longer than the shortest delay, so what a delay puts out in it was computed
before: on each panel between two edges a polynomial of degree 4, whose coefficients are held
inputs of the compiled code. Edges are the samples, the updates, and the times at which a delayed
signal has a jump or a kink. A panel on which a signal that will be delayed is not smooth enough is
halved, and its segment is run again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..expression.graph import Node, evaluate, rename
from ..tracing.equations import Program
from ..tracing.network import Net
from ..tracing.tracer import Tick, traced_net
from .course import Accuracy, Course, Now, Track
from .memo import ALONE, Engine, made_of

SEGMENTS = 50_000  # of a run at most; a shorter delay stays an approximation
HALVINGS = 24  # rounds of them in a segment at most
SHORTEST = 1e-6  # of the shortest delay: a panel that is not halved
NODES = np.arange(5) / 4  # of a panel, as parts of its length
_FIT = np.linalg.inv(np.vander(NODES, increasing=True))
_FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
INSIDE = 1e-5  # part of a panel by which its ends are moved inwards to find the side of a jump


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


_made: WeakKeyDictionary[Engine, dict[tuple[int, ...], Engine]] = WeakKeyDictionary()


def run_late(
    engine: Engine,
    net: Net,
    course: Course,
    starts: tuple[np.ndarray, np.ndarray],
    params: Mapping[str, Any] | None,
    accuracy: Accuracy,
) -> Track | None:
    """The track of a net with exact dead times, from its continuous and sampled states.

    None where a net has no dead times.
    """
    exact = exact_states(engine.flow, params, course.grid)
    if not exact:
        return None
    with ALONE:
        kept = _made.setdefault(engine, {})
        if exact not in kept:
            kept[exact] = _compiled(net, params, exact, engine.backend)
    return _Run(kept[exact], net, course, starts, params, accuracy).track(exact)


def _compiled(
    net: Net, params: Mapping[str, Any] | None, late: tuple[int, ...], backend: str | None
) -> Engine:
    """The code of a net with held inputs in place of its inputs and delayed signals.

    They are m values, m slopes, five coefficients of each delayed signal, and the start of the
    panel. Behind the signals come those that will be delayed.
    """
    m = len(net.outside)
    more = tuple(f"held {k}" for k in range(m + 5 * len(late) + 1))
    wide = replace(net, outside=(*net.outside, *more))
    hybrid = traced_net(wide, params, exact=late).sharpened(params)
    flow, tick, zero = hybrid.flow, hybrid.tick, hybrid.flow.graph.constant(0.0)
    rates = [zero if i in late else rate for i, rate in enumerate(flow.xdot)]
    y = [*flow.y, *(flow.xdot[i] for i in late)]
    names = [flow.graph.symbol(f"u{k}") for k in range(len(wide.outside))]
    roots = rename([*rates, *y, *hybrid.ticked], _by_time(flow, late, m, names))
    n, k = len(rates), len(rates) + len(y)
    if tick is not None:
        q = k + len(tick.new_q)
        tick = Tick(tick.q, tick.g, tuple(roots[k:q]), tuple(roots[q:]))
    flow = replace(
        flow,
        outputs=(*flow.outputs, *(f"late {i}" for i in late)),
        u=(*names, *flow.u[len(names) :]),
        xdot=tuple(roots[:n]),
        y=tuple(roots[n:k]),
    )
    return made_of(replace(hybrid, flow=flow, tick=tick), backend)


def _by_time(
    program: Program, late: Sequence[int], m: int, names: Sequence[Node]
) -> dict[int, Node]:
    """What takes the place of the inputs and of the delayed signals, in terms of time."""
    since = program.t - names[-1]
    to = {names[k].index: names[k] + names[m + k] * since for k in range(m)}
    for j, i in enumerate(late):
        rows = names[2 * m + 5 * j : 2 * m + 5 * j + 5]
        to[program.x[i].index] = polynomial(rows, since)
    return to


@dataclass(frozen=True)
class Piece:
    """Continuous states (n, 4 P + 1) at the nodes of P panels, and held values (k, P) in them."""

    x: np.ndarray
    held: np.ndarray


class _Run:
    """Where a run of updates and flow is; ``rows`` as of :meth:`.sampled_run.Held.part`."""

    def __init__(
        self,
        engine: Engine,
        net: Net,
        course: Course,
        starts: tuple[np.ndarray, np.ndarray],
        params: Mapping[str, Any] | None,
        accuracy: Accuracy,
    ) -> None:
        self.engine, self.net, self.course, self.accuracy = engine, net, course, accuracy
        self.p, many = engine.flow.arguments(params), len(net.held)
        self.now, self.unsettled = Now.start(*starts, many), np.nan
        counts = (*map(len, starts), many, many if net.earlier else 0)
        self.rows = [np.empty((count, len(course.grid))) for count in counts]
        self._after, self._begun = self.now, False
        self._out, self._own = [np.empty((0, 0))], (np.zeros(0, int), np.zeros(0, int))

    def track(self, late: Sequence[int]) -> Track:
        course, given = self.course, Given(self.course.grid, self.course.given, self.course.hold)
        delays, first = lates(self.engine.flow, self.p), self.now.x[[*late]]
        own = Steps(self, given, [delays[i] for i in late], first).all()
        kept = course.kept
        states, q, h, b = (row[:, kept] for row in self.rows)
        for i, row in zip(late, own, strict=True):  # in place of the approximation's states
            states[i], states[i + 1] = row[kept], 0.0
        parts = [np.vstack([row, np.zeros((4, len(row)))]) for row in own]
        u = np.vstack([given.at(slice(None)), *parts, given.t])[:, kept]
        y = self.engine.signals(course.grid[kept], states, np.vstack([u, h]), b, self.p)
        return Track(states, q, y[: len(self.net.signals)], self.unsettled)

    def advance(self, edges: np.ndarray, grid: np.ndarray, inputs: np.ndarray) -> Piece:
        """A segment from where the last accepted one ended."""
        self._own = at, own = self._places(edges)
        flags = np.zeros((len(self.course.flags), len(grid)))
        if len(flags):
            flags[:, 4 * own] = self.course.flags[:, at]
        part = Course(grid, inputs, flags, None, True)
        self._after = self.now.copy()
        self._out, unsettled = self.engine.part(part, self._after, self.p, self.accuracy)
        if np.isfinite(unsettled):
            self.unsettled = unsettled
        return Piece(self._out[0], self._out[2][:, :-1:4])

    def accept(self) -> None:
        """Go on from the end of the last segment."""
        at, own = self._own
        for row, found in zip(self.rows, self._out, strict=True):
            if len(row):
                row[:, at] = found[:, 4 * own]
        self.now, self._begun = self._after, True

    def sources(self, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The signals before their delays, (d, N)."""
        held = len(u) - len(self.net.held)
        before = u[held:] if self.net.earlier else np.empty((0, len(t)))
        return self.engine.signals(t, x, u, before, self.p)[len(self.net.signals) :]

    def _places(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The grid points among the edges, and the places of these edges."""
        grid = self.course.grid
        at = np.minimum(np.searchsorted(grid, edges), len(grid) - 1)
        new = grid[at] == edges
        new[0] &= not self._begun  # the last segment ended there, after its update
        return at[new], np.flatnonzero(new)


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


class Steps:
    """One run over the times ``given.t``."""

    def __init__(self, run: _Run, given: Given, delays: Sequence[float], first: Any) -> None:
        t = given.t
        self.run, self.given, self.t, self.rtol = run, given, t, run.accuracy.rtol
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
                piece = self.run.advance(edges, grid, inputs)
                values = self._sources(edges, columns, piece)
                rough = self._rough(edges, values, 10.0, growing=True)
                if not rough.any() or again == HALVINGS:
                    self._accept(edges, values)
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
        found = self.run.sources(nodes(edges).ravel(), piece.x[:, at.ravel()], u)
        return found.reshape(-1, many, 5)

    def _accept(self, edges: np.ndarray, values: np.ndarray) -> None:
        for past, own in zip(self.past, values, strict=True):
            self.breaks += map(self._on_grid, past.extend(edges, own, self.rtol))
        self.run.accept()


def coefficients(values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Polynomials in the time since the start of each panel, (P, 5), from their values (P, 5)."""
    return (values @ _FIT.T) / lengths[:, None] ** np.arange(5)


def polynomial(rows: Any, since: Any) -> Any:
    """The value of a polynomial from its coefficients, lowest power first: numbers or nodes."""
    value = rows[-1]
    for row in rows[-2::-1]:
        value = value * since + row
    return value


def roughness(values: np.ndarray) -> np.ndarray:
    """The fourth difference of the values (P, 5) at the nodes: above the error of the fit."""
    return np.abs(values @ _FOURTH)


def nodes(edges: np.ndarray) -> np.ndarray:
    """The nodes (P, 5) of the panels between the edges (P + 1,)."""
    made = edges[:-1, None] + np.diff(edges)[:, None] * NODES
    made[:, -1] = edges[1:]
    return made


class History:
    """One signal until now; constant before ``start``."""

    def __init__(self, start: float, value: float, delay: float) -> None:
        self.delay, self.size = float(delay), abs(float(value))
        self._starts = np.array([start - 1.0])
        self._rows = np.array([[value, 0.0, 0.0, 0.0, 0.0]])

    def late(self, edges: np.ndarray) -> np.ndarray:
        """The delayed signal at the nodes (P, 5) of panels; at a jump, on the panel's own side."""
        at = nodes(edges) - self.delay
        middle = at[:, 2:3]
        return self._values(at, middle + (1.0 - INSIDE) * (at - middle))

    def late_from(self, t: np.ndarray, length: float) -> np.ndarray:
        """The delayed signal just after the times t (N,)."""
        at = t - self.delay
        return self._values(at, at + INSIDE * length)

    def _values(self, at: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        k = np.maximum(np.searchsorted(self._starts, chosen, side="right") - 1, 0)
        s, rows = at - self._starts[k], self._rows[k]
        return polynomial(np.moveaxis(rows, -1, 0), s)

    def extend(self, edges: np.ndarray, values: np.ndarray, rtol: float) -> list[float]:
        """Add panels with their values (P, 5); the times at which the delayed signal is not
        smooth."""
        lengths = np.diff(edges)
        rows = coefficients(values, lengths)
        self.size = max(self.size, float(np.max(np.abs(values))))
        before = np.vstack([self._rows[-1:], rows[:-1]])
        since = np.append(edges[0] - self._starts[-1], lengths[:-1])
        powers = since[:, None] ** np.arange(5)
        jump = np.abs(np.sum(before * powers, axis=1) - rows[:, 0])
        slope = np.sum(before[:, 1:] * np.arange(1, 5) * powers[:, :-1], axis=1)
        bend = np.abs(slope - rows[:, 1]) * np.minimum(lengths, np.append(lengths[0], since[1:]))
        broken = edges[:-1][np.maximum(jump, bend) > 10 * rtol * self.size]
        recent = np.searchsorted(self._starts, edges[-1] - 2.0 * self.delay) - 1
        kept = slice(max(int(recent), 0), None)
        self._starts = np.append(self._starts[kept], edges[:-1])
        self._rows = np.vstack([self._rows[kept], rows])
        return [float(t) + self.delay for t in broken]


def joined(edges: Sequence[float], more: Sequence[float], near: float) -> np.ndarray:
    """Sorted edges with the other times that are farther than ``near`` from all of them."""
    made = np.array(edges, dtype=float)
    for t in sorted(more):
        if np.min(np.abs(made - t)) > near:
            made = np.append(made, t)
    return np.sort(made)
