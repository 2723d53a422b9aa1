"""Runs of a single system with exact dead times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..tracing.equations import Program
from ..tracing.tracer import single
from .adaptive_run import Adaptive, Run
from .delay_steps import Given, Piece, Steps, by_time, exact_states, held_at, lates, with_late
from .memo import ALONE

_made: WeakKeyDictionary[Adaptive, dict[tuple[int, ...], Delayed]] = WeakKeyDictionary()


def delayed(
    engine: Adaptive, system: Any, t: np.ndarray, params: Mapping[str, Any] | None
) -> Delayed | None:
    """The run with exact dead times; None for a system without any."""
    exact = exact_states(engine.program, params, t)
    if not exact:
        return None
    with ALONE:
        kept = _made.setdefault(engine, {})
        if exact not in kept:
            system._update_params(params)
            program = single(system, exact).sharpened(params)
            kept[exact] = Delayed(program, exact, engine.backend)
    return kept[exact]


class Delayed:
    """Compiled run of a system whose delays, the states ``late``, are exact."""

    def __init__(self, program: Program, late: tuple[int, ...], backend: str) -> None:
        self.late, self.program = late, program
        zero, n = program.graph.constant(0.0), len(program.x)
        rates = [zero if i in late else rate for i, rate in enumerate(program.xdot)]
        sources = [program.xdot[i] for i in late]
        roots = [*rates, *program.y, *sources]
        roots, names = by_time(program, late, len(program.u), roots)
        held = replace(
            program,
            inputs=tuple(node.value for node in names),
            outputs=(*program.outputs, *(f"late {i}" for i in late)),
            u=tuple(names),
            xdot=tuple(roots[:n]),
            y=tuple(roots[n:]),
        )
        self.engine = Adaptive(held, backend)

    def run(
        self,
        t: np.ndarray,
        u: np.ndarray,
        x0: np.ndarray,
        params: Mapping[str, Any] | None,
        *,
        hold: bool,
        rtol: float,
        atol: float | None = None,
    ) -> tuple[Run, np.ndarray]:
        """States and outputs at the times t. Raises ``Diverged`` as ``Adaptive.run`` does."""
        p, given = self.program.arguments(params), Given(t, u, hold)
        delays = lates(self.program, p)
        flow = _Flow(self, t, x0, p, rtol, atol)
        late = Steps(flow, given, [delays[i] for i in self.late], x0[[*self.late]], rtol).all()
        x = with_late(flow.states, dict(zip(self.late, late, strict=True)))
        y = self.engine.outputs(t, x, held_at(given, late), p)[: len(self.program.y)]
        return Run(x, flow.steps, flow.unsettled), y


class _Flow:
    """Where a run is."""

    def __init__(
        self, of: Delayed, t: np.ndarray, x0: np.ndarray, p: Any, rtol: float, atol: Any
    ) -> None:
        self.of, self.t, self.p, self.rtol, self.atol = of, t, p, rtol, atol
        self.x, self.sizes = np.array(x0, dtype=float), np.zeros(3 * len(x0))
        self.steps, self.unsettled, self._after = 0, np.nan, self.sizes
        self.states = np.empty((len(x0), len(t)))
        self.states[:, 0] = x0

    def advance(self, edges: np.ndarray, grid: np.ndarray, inputs: np.ndarray) -> Piece:
        self._after = self.sizes.copy()
        run = self.of.engine.run(
            grid,
            inputs,
            self.x,
            self.p,
            hold=True,
            rtol=self.rtol,
            atol=self.atol,
            sizes=self._after,
        )
        self.steps += run.steps
        if np.isfinite(run.unsettled):
            self.unsettled = run.unsettled
        return Piece(run.states, np.empty((0, len(edges) - 1)))

    def accept(self, edges: np.ndarray, piece: Piece) -> None:
        self.x, self.sizes = piece.x[:, -1].copy(), self._after
        at = np.minimum(np.searchsorted(self.t, edges), len(self.t) - 1)
        own = self.t[at] == edges
        self.states[:, at[own]] = piece.x[:, 4 * np.flatnonzero(own)]

    def sources(self, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        return self.of.engine.outputs(t, x, u, self.p)[len(self.of.program.y) :]
