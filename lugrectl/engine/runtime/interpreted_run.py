"""A net whose sampled blocks, or all blocks, are called instead of traced."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ...core.errors import Diverged
from ..tracing.network import Net
from ..tracing.pointwise import Answer, Instant, settle
from ..tracing.tracer import traced_net
from .adaptive_run import Accuracy, Adaptive, Course, Track, not_finite
from .endings import SIGN, Chatter, said_if_slow

Advance = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, float]]


class Called:
    """A net evaluated by its blocks' own functions.

    ``method`` is one of ``scipy.integrate.solve_ivp`` for the flow; None: the traced flow, with a
    TraceError if it cannot be traced. ``why`` says why a block is not compiled, for a warning
    where this takes long.
    """

    def __init__(
        self,
        net: Net,
        params: Mapping[str, Any] | None = None,
        method: str | None = None,
        why: str = "",
    ) -> None:
        self.net, self.params, self.method, self.why = net, params, method, why
        self._loops: dict[Any, np.ndarray] = {}
        self._at = [Instant(part.block, part.block.name) for part in net.parts]
        self._whole = Instant(None, net.name)
        self._held = np.repeat([p.sampled for p in net.parts], [len(p.outputs) for p in net.parts])
        self.engine: Adaptive | None = None
        if method is None and net.count(False) > 0:
            hybrid = traced_net(net, params, ticks=False)
            hybrid.check(params)
            self.engine = Adaptive(hybrid.flow)

    def follow(self, course: Course, x: np.ndarray, q: np.ndarray, accuracy: Accuracy) -> Track:
        """As :meth:`lugrectl.engine.runtime.adaptive_run.Held.follow`."""
        how = "at each of its updates" if self.engine is not None else ""
        slow, loud = said_if_slow(self.why, how), warnings.catch_warnings()
        with slow, loud, np.errstate(all="ignore"):
            # LSODA warns of convergence; the error names state and time
            warnings.filterwarnings("ignore", "lsoda", UserWarning)
            for part in self.net.parts:
                part.block._update_params(self.params)
            return self._followed(course, x, q, self._advance(course, x, accuracy))

    def _followed(self, course: Course, x: np.ndarray, q: np.ndarray, advance: Advance) -> Track:
        net, ticks, columns = self.net, course.ticks, course.columns
        states, signals, unsettled = [], [], [np.nan]
        h, x, q = np.zeros(len(net.held)), x.copy(), q.copy()
        for k, t in enumerate(course.grid):
            u = course.given[:, k]
            _, before = self._outputs(t, x, h, u)
            y, start = before, q
            if ticks[k]:
                h, q, y = self._tick(t, (x, q), before, u, course.flags[:, k])
            if columns[k] >= 0:
                states.append(np.concatenate([x, start]))
                shown = (before if net.earlier else y).copy()
                shown[self._held] = h  # the sampled ones after the update
                signals.append(net.gather @ shown if np.isfinite(shown).all() else shown)
            if k + 1 < len(course.grid) and len(x):
                rows = np.vstack([course.given[:, k : k + 2], np.repeat(h[:, None], 2, axis=1)])
                x, relay = advance(course.grid[k : k + 2], rows, x)
                unsettled.append(relay)
        whole, n = np.array(states).T, len(x)
        first = next((t for t in unsettled if np.isfinite(t)), np.nan)
        return Track(whole[:n], whole[n:], np.array(signals).T, float(first))

    def _outputs(self, t: float, x: np.ndarray, h: np.ndarray, u: np.ndarray) -> Any:
        """Inputs and outputs of all parts between updates."""
        if self.net.alone and not self.net.groups:
            return [u], np.reshape(np.asarray(self._at[0].outputs(t, x, u), dtype=float), -1)
        if not self.net.groups:
            return self._whole.through(self.net.wires, t, x, u)
        y = np.zeros(len(self._held))
        y[self._held] = h
        answers = [None if p.sampled else self._of(i, t, x) for i, p in enumerate(self.net.parts)]
        return settle(self.net.wires, u, answers, y, self._loops)

    def _of(self, i: int, t: float, states: np.ndarray) -> Answer:
        at, own = self._at[i], states[self.net.places[i]]
        return lambda inputs: np.asarray(at.outputs(t, own, inputs), dtype=float).reshape(-1)

    def _tick(
        self,
        t: float,
        states: tuple[np.ndarray, np.ndarray],
        before: np.ndarray,
        u: np.ndarray,
        flags: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Held values and sampled states after an update, and the outputs of all parts."""
        net, (x, q) = self.net, states
        answers: list[Answer] = []
        for i, part in enumerate(net.parts):
            acts = not net.earlier if part.group is None else flags[part.group] > 0.25
            answers.append(self._of(i, t, q if part.sampled else x) if acts else None)
        inputs, y = settle(net.wires, u, answers, before, self._loops)
        h, fresh = y[self._held], q.copy()
        for i, part in enumerate(net.parts):
            if part.group is not None and part.nstates and flags[part.group] > 0.75:
                place = net.places[i]
                fresh[place] = np.reshape(self._at[i].rates(t, q[place], inputs[i]), -1)
        if not np.all(np.isfinite(np.concatenate([h, fresh]))):
            raise Diverged(not_finite(net, fresh, h, t))
        return h, fresh, y

    def _advance(self, course: Course, x: np.ndarray, accuracy: Accuracy) -> Advance:
        """How to step the states: by the traced flow, or by SciPy, in one run where that can be."""
        if self.engine is not None:
            engine, p = self.engine, self.engine.program.arguments(self.params)
            options = {"hold": course.hold, "rtol": accuracy.rtol, "atol": accuracy.atol}

            def traced(t: np.ndarray, rows: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, float]:
                part = engine.run(t, rows, x, p, **options)
                return part.states[:, -1], part.unsettled

            return traced
        chatter = Chatter(self.net.name, course.grid[-1] - course.grid[0])
        given: Any = {"method": self.method or "LSODA", **accuracy.scipy, "events": chatter}

        def called(t: np.ndarray, rows: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, float]:
            return self._solved(t, rows, x, course.hold, given)[:, -1], np.nan

        if self.net.groups or course.hold or len(course.grid) < 2 or not len(x):
            return called
        try:
            columns = iter(self._solved(course.grid, course.given, x, False, given).T[1:])
        except Diverged:
            if chatter.found:
                raise
            for at in (*self._at, self._whole):
                at.culprit = ""
            return called  # step by step, which finds the time
        return lambda *_: (next(columns), np.nan)

    def _solved(
        self, t: np.ndarray, rows: np.ndarray, x: np.ndarray, hold: bool, given: Any
    ) -> np.ndarray:
        """States (n, N) at the times, for inputs and held values (m, N), linear or held."""
        m, last = len(self.net.outside), len(t) - 2

        def rates(now: float, state: np.ndarray) -> np.ndarray:
            k = min(int(np.searchsorted(t[1:], now, side="right")), last)
            share = 0.0 if hold else (now - t[k]) / (t[k + 1] - t[k])
            u = rows[:, k] + share * (rows[:, k + 1] - rows[:, k])
            if self.net.alone:
                return self._at[0].rates(now, state, u)
            inputs, _ = self._outputs(now, state, u[m:], u[:m])
            parts = zip(self.net.parts, self._at, self.net.places, inputs, strict=True)
            flows = [
                np.reshape(at.rates(now, state[place], own), -1)
                for part, at, place, own in parts
                if not part.sampled and part.nstates
            ]
            return np.concatenate(flows)

        done = solve_ivp(rates, (t[0], t[-1]), x, t_eval=t, **given)
        end = done.y[:, -1] if done.y.size else x
        if not done.success or not np.isfinite(end).all():
            i = int(np.argmax(np.where(np.isfinite(end), np.abs(end), np.inf)))
            label, why = self.net.states(sampled=False)[i], done.message.rstrip(".")
            raise Diverged(
                f"{self.net.name}: the solver stops at t = {done.t[-1]:.6g} s, where state {label} "
                f"is {end[i]:.3g}: {why}.{SIGN if self.net.looped else ''}"
            )
        return done.y
