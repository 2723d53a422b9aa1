"""Exact dead times by the method of steps: a run segment by segment.

A segment is no longer than the shortest delay: what a delay puts out in it was computed before, on
each panel a polynomial of degree 4, whose coefficients are held inputs of the compiled code. Panels
end at samples, updates, jumps and kinks; one that is not smooth enough is halved and run again.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from .adaptive_run import Accuracy, Course, Engine, Now, Track
from .graph import Node, evaluate, rename
from .memo import ALONE
from .tracer import Hybrid, Net, Program, traced_net

SEGMENTS = 50_000  # of a run at most; a shorter delay stays an approximation
HALVINGS = 24  # rounds of them in a segment at most
SHORTEST = 1e-6  # of the shortest delay: a panel that is not halved
INSIDE = 1e-5  # part of a panel between its last node and its end
NODES = np.array([0.0, 0.25, 0.5, 0.75, 1.0 - INSIDE])  # of a panel, as parts of its length
_FIT = np.linalg.inv(np.vander(NODES, increasing=True))
_FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])


def lates(program: Program, p: np.ndarray) -> dict[int, float]:
    """The delay in s of each state that is a delayed signal."""
    late = program.graph.late
    names = {node.value: v for node, v in zip(program.p, p, strict=True)}
    places = {i: late[x.index] for i, x in enumerate(program.x) if x.index in late}
    return {
        i: float(evaluate([delay], names)[0]) if isinstance(delay, Node) else float(delay)
        for i, delay in places.items()
    }


_made: WeakKeyDictionary[Engine, dict[tuple[int, ...], Engine]] = WeakKeyDictionary()


def run_late(
    engine: Engine,
    course: Course,
    starts: tuple[np.ndarray, np.ndarray],
    params: Mapping[str, Any] | None,
    accuracy: Accuracy,
) -> Track | None:
    """The track of a net with exact dead times; None without one of a sensible length."""
    program, t = engine.program, course.grid
    if not program.graph.late or len(t) < 2:
        return None
    least = (t[-1] - t[0]) / SEGMENTS
    delays = lates(program, program.arguments(params))
    exact = {i: delay for i, delay in delays.items() if delay > least}
    if not exact:
        return None
    with ALONE:
        kept = _made.setdefault(engine, {})
        if (late := tuple(exact)) not in kept:
            kept[late] = Engine(_by_time(engine.net, params, late), engine.backend)
    p = kept[late].program.arguments(params)
    return _Run(kept[late], course, starts, p, accuracy, exact).whole.at(course.kept)


def _by_time(net: Net, params: Mapping[str, Any] | None, late: tuple[int, ...]) -> Hybrid:
    """A net with held inputs: m values, m slopes, five coefficients of each delayed signal, and the
    start of the panel. Behind the signals come those to be delayed, then the delayed ones."""
    m = len(net.outside)
    more = tuple(f"held {k}" for k in range(m + 5 * len(late) + 1))
    wide = replace(net, outside=(*net.outside, *more))
    hybrid = traced_net(wide, params, exact=late).sharpened(params)
    flow, zero = hybrid.flow, hybrid.flow.graph.constant(0.0)
    rates = [zero if i in late else rate for i, rate in enumerate(flow.xdot)]
    y = [*flow.y, *(flow.xdot[i] for i in late), *(flow.x[i] for i in late)]
    names = [flow.graph.symbol(f"u{k}") for k in range(len(wide.outside))]
    since = flow.t - names[-1]
    by_time = {names[k].index: names[k] + names[m + k] * since for k in range(m)}
    for j, i in enumerate(late):
        by_time[flow.x[i].index] = polynomial(names[2 * m + 5 * j : 2 * m + 5 * j + 5], since)
    roots = rename([*rates, *y, *hybrid.ticked], by_time)
    n, k = len(rates), len(rates) + len(y)
    q = k + len(hybrid.new_q)
    flow = replace(
        flow,
        outputs=(*flow.outputs, *(f"late {i}" for i in range(2 * len(late)))),
        u=(*names, *flow.u[len(names) :]),
        xdot=tuple(roots[:n]),
        y=tuple(roots[n:k]),
    )
    return replace(hybrid, flow=flow, new_q=tuple(roots[k:q]), new_h=tuple(roots[q:]))


class _Run:
    """A run of updates and flow with the delays ``late`` of its states: ``whole`` is its track."""

    def __init__(
        self,
        engine: Engine,
        course: Course,
        starts: tuple[np.ndarray, np.ndarray],
        p: np.ndarray,
        accuracy: Accuracy,
        late: Mapping[int, float],
    ) -> None:
        self.engine, self.course, self.p, self.accuracy = engine, course, p, accuracy
        self.now, t, count = Now.start(*starts, engine.held), course.grid, len(late)
        x, q, y = (np.empty((len(rows), len(t))) for rows in (*starts, engine.outputs))
        self.whole = Track(x, q, y)
        self.past = [History(t[0], self.now.x[i], delay) for i, delay in late.items()]
        self.longest, self.near = min(late.values()), 1e-10 * (t[-1] - t[0])
        self.breaks = [self._on_grid(t[0] + delay) for delay in late.values()]
        now = float(t[0])
        while now < t[-1]:
            now = float(self._segment(self._edges(now))[-1])
        for i, row in zip(late, y[-count:], strict=True):  # for the approximation's states
            x[i], x[i + 1] = row, 0.0
        self.whole = replace(self.whole, y=y[: -2 * count])

    def _edges(self, now: float) -> np.ndarray:
        """From now to the last edge that is not more than the shortest delay away."""
        t, reach = self.course.grid, [now, now + self.longest + self.near]
        first, last = np.searchsorted(t, reach, side="right")
        edges = np.array([now, *t[first:last]])
        for k in sorted(b for b in self.breaks if now + self.near < b <= reach[1]):
            if np.min(np.abs(edges - k)) > self.near:
                edges = np.append(edges, k)
        edges = np.sort(edges)
        if edges[-1] < now + 0.5 * self.longest and edges[-1] < t[-1]:
            edges = np.append(edges, self._on_grid(now + self.longest))
        self.breaks = [b for b in self.breaks if b > edges[-1] + self.near]
        return edges

    def _on_grid(self, t: float) -> float:
        """The time itself, or the sample that differs from it only by rounding."""
        grid = self.course.grid
        k = int(np.searchsorted(grid, t))
        near = [float(a) for a in grid[max(k - 1, 0) : k + 1] if abs(a - t) <= self.near]
        return near[0] if near else t

    def _segment(self, edges: np.ndarray) -> np.ndarray:
        """Run a segment, in panels on which all delayed signals are smooth; its edges."""
        for again in range(HALVINGS + 1):
            values = np.array([past.late(edges) for past in self.past])
            rough = self._rough(edges, values, 20.0, growing=False)
            if not rough.any() or again == HALVINGS:
                after, track = self._advance(edges, values)
                values = track.y[-2 * len(values) : -len(values), :-1].reshape(values.shape)
                rough = self._rough(edges, values, 10.0, growing=True)
                if not rough.any() or again == HALVINGS:
                    self._accept(edges, values, after, track)
                    return edges
            edges = np.sort(np.append(edges, 0.5 * (edges[:-1] + edges[1:])[rough]))
        raise AssertionError("unreachable")

    def _rough(
        self, edges: np.ndarray, values: np.ndarray, factor: float, *, growing: bool
    ) -> np.ndarray:
        """The panels with a fourth difference at the nodes above the error that is allowed."""
        rough = np.zeros(len(edges) - 1, dtype=bool)
        for past, own in zip(self.past, values, strict=True):
            size = max(past.size, float(np.max(np.abs(own)))) if growing else past.size
            rough |= np.abs(own @ _FOURTH) > factor * self.accuracy.rtol * size
        return rough & (np.diff(edges) > SHORTEST * self.longest)

    def _on_edges(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places of the grid points in [first, last), and those of their edges at the nodes."""
        t = self.course.grid
        at = np.searchsorted(t, edges)
        new = t[np.minimum(at, len(t) - 1)] == edges
        new[-1] = edges[-1] == t[-1]  # the next segment begins there
        return at[new], 5 * np.flatnonzero(new)

    def _advance(self, edges: np.ndarray, late: np.ndarray) -> tuple[Now, Track]:
        """The end of a segment, and its track at the nodes and at the last edge."""
        t, u, end = self.course.grid, self.course.given, edges[-1]
        rows = [coefficients(own, np.diff(edges)).T for own in late]
        columns = np.vstack([self._panels(edges), *rows, edges[None, :-1]])
        last = columns[:, -1:]
        if end == t[-1]:
            own = [[past.late_at(end, self.longest), 0, 0, 0, 0] for past in self.past]
            last = np.concatenate([u[:, -1], 0.0 * u[:, -1], *own, [end]])[:, None]
        at, own = self._on_edges(edges)
        flags = np.zeros((len(self.course.flags), 5 * columns.shape[1] + 1))
        flags[:, own] = self.course.flags[:, at]
        after, grid = deepcopy(self.now), np.append(nodes(edges).ravel(), end)
        inputs = np.append(np.repeat(columns, 5, axis=1), last, axis=1)
        part = Course(grid, inputs, flags, True)
        return after, self.engine.run(part, after, self.p, self.accuracy)

    def _accept(self, edges: np.ndarray, values: np.ndarray, after: Now, track: Track) -> None:
        for past, own in zip(self.past, values, strict=True):
            self.breaks += map(self._on_grid, past.extend(edges, own, self.accuracy.rtol))
        at, own = self._on_edges(edges)
        for name in "xqy":
            getattr(self.whole, name)[:, at] = getattr(track, name)[:, own]
        if np.isfinite(track.unsettled):
            self.whole = replace(self.whole, unsettled=track.unsettled)
        self.now = after

    def _panels(self, edges: np.ndarray) -> np.ndarray:
        """Value and slope (2 m, P) of the inputs at the start of each panel."""
        t, u, middle = self.course.grid, self.course.given, 0.5 * (edges[:-1] + edges[1:])
        k = np.clip(np.searchsorted(t, middle, side="right") - 1, 0, len(t) - 2)
        slope = 0.0 * u[:, k] if self.course.hold else (u[:, k + 1] - u[:, k]) / (t[k + 1] - t[k])
        return np.vstack([u[:, k] + slope * (edges[:-1] - t[k]), slope])


def coefficients(values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Polynomials in the time since the start of each panel, (P, 5), from their values (P, 5)."""
    return (values @ _FIT.T) / lengths[:, None] ** np.arange(5)


def polynomial(rows: Any, since: Any) -> Any:
    """The value of a polynomial from its coefficients, lowest power first: numbers or nodes."""
    value = rows[-1]
    for row in rows[-2::-1]:
        value = value * since + row
    return value


def nodes(edges: np.ndarray) -> np.ndarray:
    """The nodes (P, 5) of the panels between the edges (P + 1,)."""
    return edges[:-1, None] + np.diff(edges)[:, None] * NODES


class History:
    """One signal until now; constant before ``start``."""

    def __init__(self, start: float, value: float, delay: float) -> None:
        self.delay, self.size = float(delay), abs(float(value))
        self._starts = np.array([start - 1.0])
        self._rows = np.array([[value, 0.0, 0.0, 0.0, 0.0]])

    def late(self, edges: np.ndarray) -> np.ndarray:
        """The delayed signal at the nodes (P, 5) of panels; at a jump, on the panel's own side."""
        return self.late_at(nodes(edges), np.diff(edges)[:, None])

    def late_at(self, t: Any, length: Any) -> Any:
        """The delayed signal just after times that lie in panels of a length."""
        at = t - self.delay
        k = np.searchsorted(self._starts, at + 0.5 * INSIDE * length, side="right") - 1
        k = np.maximum(k, 0)
        return polynomial(np.moveaxis(self._rows[k], -1, 0), at - self._starts[k])

    def extend(self, edges: np.ndarray, values: np.ndarray, rtol: float) -> list[float]:
        """Add panels with values (P, 5); the times at which the delayed signal is not smooth."""
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
