"""Runs of continuous and sampled blocks together with exact dead times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..tracing.network import Net
from ..tracing.network_equations import Hybrid, Tick, traced_net
from .delay_steps import (
    Given,
    Piece,
    Steps,
    by_time,
    exact_states,
    held_at,
    inputs_of,
    lates,
    with_late,
)
from .memo import ALONE
from .sampled_run import Course, Held, Now, Track

_made: WeakKeyDictionary[Held, dict[tuple[int, ...], Held]] = WeakKeyDictionary()


def run_late(
    held: Any,
    net: Net,
    course: Course,
    x: np.ndarray,
    q: np.ndarray,
    params: Mapping[str, Any] | None,
    rtol: float,
    atol: float | None,
) -> Track | None:
    """The track of a net with exact dead times; None where a net has none."""
    if not isinstance(held, Held):
        return None
    flow = held.hybrid.flow
    exact = exact_states(flow, params, course.grid)
    if not exact:
        return None
    with ALONE:
        kept = _made.setdefault(held, {})
        if exact not in kept:
            kept[exact] = _compiled(net, params, exact, held.backend)
    return _run(kept[exact], exact, course, x, q, params, rtol, atol)


def _compiled(
    net: Net, params: Mapping[str, Any] | None, late: tuple[int, ...], backend: str | None
) -> Held:
    """The code of a net with held inputs in place of its inputs and delayed signals."""
    m = len(net.outside)
    more = tuple(f"held {k}" for k in range(inputs_of(m, len(late)) - m))
    wide = replace(net, outside=(*net.outside, *more))
    hybrid = traced_net(wide, params, exact=late).sharpened(params)
    flow, tick = hybrid.flow, hybrid.tick
    assert tick is not None
    zero = flow.graph.constant(0.0)
    rates = [zero if i in late else rate for i, rate in enumerate(flow.xdot)]
    groups = [rates, hybrid.y, [flow.xdot[i] for i in late], tick.new_q, tick.new_h]
    roots, _ = by_time(flow, late, m, [node for group in groups for node in group])
    ends = np.cumsum([0, *map(len, groups)])
    rates, y, sources, new_q, new_h = (
        tuple(roots[a:b]) for a, b in zip(ends, ends[1:], strict=False)
    )
    made = Hybrid(
        hybrid.net,
        replace(flow, xdot=rates),
        y + sources,
        Tick(tick.q, tick.g, new_q, new_h),
        hybrid.blocks,
    )
    return Held(made, backend)


def _run(
    held: Held,
    exact: tuple[int, ...],
    course: Course,
    x: np.ndarray,
    q: np.ndarray,
    params: Mapping[str, Any] | None,
    rtol: float,
    atol: float | None,
) -> Track:
    flow, given = held.hybrid.flow, Given(course.grid, course.given, course.hold)
    p = flow.arguments(params)
    delays = lates(flow, p)
    alternation = _Alternation(held, course, Now.start(held.hybrid, x, q), p, rtol, atol)
    late = Steps(alternation, given, [delays[i] for i in exact], x[[*exact]], rtol).all()
    kept = course.kept
    rows = [row[:, kept] for row in alternation.rows]
    states = with_late(rows[0], {i: row[kept] for i, row in zip(exact, late, strict=True)})
    u = np.vstack([held_at(given, late)[:, kept], rows[2]])
    y = held.signals(course.grid[kept], states, u, rows[3], p)[: len(held.hybrid.net.signals)]
    return Track(states, rows[1], y, alternation.unsettled)


class _Alternation:
    """Where a run of updates and flow is; ``rows`` as of :meth:`Held.part`."""

    def __init__(
        self, held: Held, course: Course, now: Now, p: np.ndarray, rtol: float, atol: float | None
    ) -> None:
        self.held, self.course, self.now = held, course, now
        self.p, self.rtol, self.atol, self.unsettled = p, rtol, atol, np.nan
        many = len(now.h)
        counts = (len(now.x), len(now.q), many, many if held.hybrid.net.earlier else 0)
        self.rows = [np.empty((count, len(course.grid))) for count in counts]
        self._after, self._out, self._begun = now, [np.empty((0, 0))], False

    def advance(self, edges: np.ndarray, grid: np.ndarray, inputs: np.ndarray) -> Piece:
        at, own = self._places(edges)
        flags = np.zeros((len(self.course.flags), len(grid)))
        flags[:, 4 * np.flatnonzero(own)] = self.course.flags[:, at[own]]
        part = Course(grid, inputs, flags, np.arange(len(grid)), True)
        self._after = self.now.copy()
        self._out, unsettled = self.held.part(part, self._after, self.p, self.rtol, self.atol)
        if np.isfinite(unsettled):
            self.unsettled = unsettled
        return Piece(self._out[0], self._out[2][:, :-1:4])

    def accept(self, edges: np.ndarray, piece: Piece) -> None:
        at, own = self._places(edges)
        for row, found in zip(self.rows, self._out, strict=True):
            row[:, at[own]] = found[:, 4 * np.flatnonzero(own)]
        self.now, self._begun = self._after, True

    def sources(self, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        net = self.held.hybrid.net
        before = u[len(net.outside) :] if net.earlier else np.empty((0, len(t)))
        return self.held.signals(t, x, u, before, self.p)[len(net.signals) :]

    def _places(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The grid points of the edges, and which edges are new ones."""
        grid = self.course.grid
        at = np.minimum(np.searchsorted(grid, edges), len(grid) - 1)
        own = grid[at] == edges
        own[0] &= not self._begun  # the last segment ended there, after its update
        return at, own
