"""A net whose sampled blocks, or all blocks, are called instead of traced."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ...core.errors import Diverged
from ..codegen.python_source import Section, indent
from ..expression.graph import Node, symbols_in
from ..tracing.network import Net
from ..tracing.tracer import traced_net
from .adaptive_run import Accuracy, Course, Engine, Now, Track, chosen_backend, not_finite
from .backend import load
from .endings import SIGN, Chatter

Advance = Callable[[np.ndarray, np.ndarray, Now], tuple[np.ndarray, float]]


class Called:
    """A net evaluated by its blocks' own functions, connected as the traced ones are.

    ``method`` is one of ``scipy.integrate.solve_ivp`` for the flow; None: the traced flow, with a
    TraceError if it cannot be traced.
    """

    def __init__(
        self, net: Net, params: Mapping[str, Any] | None = None, method: str | None = None
    ) -> None:
        self.net, self.params, self.method, self.engine = net, params, method, None
        if method is None and net.count(False) > 0:
            flow = traced_net(net, params, ticks=False)
            flow.check()
            self.engine = Engine(flow, chosen_backend())
        self.hybrid = made = traced_net(net, params, called=True)
        self._rates = self._function(made.flow.xdot)
        self._shown = self._function(made.flow.y)
        self._updated = self._function(made.ticked)

    def _function(self, nodes: Sequence[Node]) -> Callable[..., list[float]]:
        """The values of nodes at t, x, u, with the held values before a tick, q and flags."""
        flow, section = (
            self.hybrid.flow,
            Section([f"row{i}" for i in range(len(nodes))], nodes, "v"),
        )
        read = [name for name in sorted(symbols_in(nodes)) if name != "t"]
        lines = [f"{name} = {name[0]}[{name[1:]}]" for name in read] + section.lines(True)
        lines += [f"return [{', '.join(section.names)}]"]
        text = f"{section.robust()}def found(p, called, t, x, u, b=(), q=(), g=()):\n"
        found = load(text + indent(lines, 1), "python").found
        return partial(found, flow.arguments(self.params).tolist(), flow.graph.called)

    def follow(self, course: Course, x: np.ndarray, q: np.ndarray, accuracy: Accuracy) -> Track:
        """As :meth:`lugrectl.engine.runtime.adaptive_run.Engine.follow`."""
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # LSODA warns of convergence; the error names state and time
            warnings.filterwarnings("ignore", "lsoda", UserWarning)
            now, net = Now.start(x, q, len(self.net.held)), self.net
            advance, ticks, unsettled = self._advance(course, now, accuracy), course.ticks, np.nan
            rows: list[list[Any]] = [[], [], []]
            for k, t in enumerate(course.grid):
                u, before = course.given[:, k], now.h.copy()
                rows[1].append(now.q.copy())
                if ticks[k]:
                    new = self._updated(t, now.x, [*u, *now.h], (), now.q, course.flags[:, k])
                    now.q[:], now.h[:] = new[: len(now.q)], new[len(now.q) :]
                    if not np.isfinite(new).all():
                        raise Diverged(not_finite(net, now.q, now.h, t))
                rows[0].append(now.x.copy())
                rows[2].append(self._shown(t, now.x, [*u, *now.h], before))
                if k + 1 < len(course.grid) and len(now.x):
                    now.x[:], relay = advance(
                        course.grid[k : k + 2], course.given[:, k : k + 2], now
                    )
                    unsettled = relay if np.isnan(unsettled) else unsettled
        x, q, y = (np.reshape(part, (len(course.grid), -1)).T for part in rows)
        return Track(x, q, y, unsettled).at(course.kept)

    def _advance(self, course: Course, now: Now, accuracy: Accuracy) -> Advance:
        """How to step the states: by the traced flow, or by SciPy, in one run where that can be."""
        if self.engine is not None:
            engine, none = self.engine, np.zeros(0)
            p = engine.program.arguments(self.params)

            def traced(t: np.ndarray, given: np.ndarray, now: Now) -> tuple[np.ndarray, float]:
                part, flags = Now(now.x.copy(), none, now.h, now.sizes), np.zeros((0, 2))
                track = engine.run(Course(t, given, flags, course.hold), part, p, accuracy)
                return part.x, track.unsettled

            return traced
        chatter = Chatter(self.net.name, course.grid[-1] - course.grid[0])
        options: Any = {"method": self.method or "LSODA", **accuracy.scipy, "events": chatter}

        def called(t: np.ndarray, given: np.ndarray, now: Now) -> tuple[np.ndarray, float]:
            return self._solved(t, given, now, course.hold, options)[:, -1], np.nan

        if self.net.groups or course.hold or len(course.grid) < 2 or not len(now.x):
            return called
        columns = iter(self._solved(course.grid, course.given, now, False, options).T[1:])
        return lambda *_: (next(columns), np.nan)

    def _solved(
        self, t: np.ndarray, given: np.ndarray, now: Now, hold: bool, options: Any
    ) -> np.ndarray:
        """States (n, N) at the times, for inputs (m, N), linear or held."""
        last = len(t) - 2

        def rates(time: float, x: np.ndarray) -> list[float]:
            k = min(int(np.searchsorted(t[1:], time, side="right")), last)
            share = 0.0 if hold else (time - t[k]) / (t[k + 1] - t[k])
            u = given[:, k] + share * (given[:, k + 1] - given[:, k])
            return self._rates(time, x, [*u, *now.h])

        done = solve_ivp(rates, (t[0], t[-1]), now.x, t_eval=t, **options)
        end = done.y[:, -1] if done.y.size else now.x
        if not done.success or not np.isfinite(end).all():
            i = int(np.argmax(np.where(np.isfinite(end), np.abs(end), np.inf)))
            label, why = self.net.states(sampled=False)[i], done.message.rstrip(".")
            raise Diverged(
                f"{self.net.name}: the solver stops at t = {done.t[-1]:.6g} s, where state {label} "
                f"is {end[i]:.3g}: {why}.{SIGN if self.net.looped else ''}"
            )
        return done.y
