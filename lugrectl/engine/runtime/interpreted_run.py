"""A net whose sampled blocks, or all blocks, are called instead of traced."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ...core.errors import Diverged
from ..tracing.instant import AlgebraicLoop, Unsolved
from ..tracing.locate_fault import Instant
from ..tracing.network import Net
from ..tracing.network_equations import trace_net
from ..tracing.pointwise import settled_values
from .adaptive_run import Adaptive
from .course import Accuracy, Course, Track
from .endings import Chatter, quiet, said_if_slow, stopped
from .sampled_run import not_finite

Rows = list[np.ndarray]
Advance = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, float]]


class Called:
    """A net evaluated by its blocks' own functions; a block is called again if an input changed.

    Parameters
    ----------
    net : Net
    params : dict, optional
        As for ``control.input_output_response``.
    method : str or None
        A method of ``scipy.integrate.solve_ivp`` for the flow; None: the traced flow, with a
        TraceError if it cannot be traced.
    why : str
        Why a block is not compiled, for a warning where this takes long.
    """

    def __init__(
        self,
        net: Net,
        params: Mapping[str, Any] | None = None,
        method: str | None = None,
        why: str = "",
    ) -> None:
        self.net, self.params, self.method, self.why = net, params, method, why
        self._loops: dict[int, np.ndarray] = {}
        self._at = [Instant(part.block) for part in net.parts]
        flowing = method is None and net.count(False) > 0
        self.engine = Adaptive(trace_net(net, params, ticks=False).flow) if flowing else None

    def follow(self, course: Course, x: np.ndarray, q: np.ndarray, accuracy: Accuracy) -> Track:
        """As :meth:`lugrectl.engine.runtime.sampled_run.Held.follow`."""
        how = "at each of its updates" if self.engine is not None else ""
        with said_if_slow(self.why, how), quiet(), np.errstate(all="ignore"):
            return self._followed(course, x, q, self._advance(course, accuracy))

    def _followed(self, course: Course, x: np.ndarray, q: np.ndarray, advance: Advance) -> Track:
        for part in self.net.parts:
            part.block._update_params(self.params)
        states, signals, unsettled = [], [], [np.nan]
        h, x, q = np.zeros(len(self.net.held)), x.copy(), q.copy()
        ticks, grid, columns = course.ticks, course.grid, course.columns
        for k, t in enumerate(grid):
            u = course.given[:, k]
            before = self._outputs(t, x, h, u)
            outputs, start = before, q
            if ticks[k]:
                h, q, outputs = self._tick(t, x, q, before, u, course.flags[:, k])
            if columns[k] >= 0:
                states.append(np.concatenate([x, start]))
                signals.append(self._signals(before if self.net.earlier else outputs, h))
            if k + 1 < len(grid) and len(x):
                rows = course.given[:, k : k + 2]
                if len(h):
                    rows = np.vstack([rows, np.repeat(h[:, None], 2, axis=1)])
                x, relay = advance(grid[k : k + 2], rows, x)
                unsettled.append(relay)
        whole, n = np.array(states).T, len(x)
        first = next((t for t in unsettled if np.isfinite(t)), np.nan)
        return Track(whole[:n], whole[n:], np.array(signals).T, float(first))

    def _outputs(self, t: float, x: np.ndarray, h: np.ndarray, u: np.ndarray) -> Rows:
        """Outputs of all parts between updates."""
        if self.net.alone and not self.net.groups:
            return [np.reshape(np.asarray(self._at[0].outputs(t, x, u), dtype=float), -1)]
        answers = [
            None if part.sampled else self._of(i, t, x) for i, part in enumerate(self.net.parts)
        ]
        return self._settle(self._apart(h), answers, u)[1]

    def _apart(self, h: np.ndarray) -> Rows:
        """Held values by part; zeros for the others."""
        rows = [np.zeros(len(part.outputs)) for part in self.net.parts]
        for (i, j), value in zip(self.net.held, h, strict=True):
            rows[i][j] = value
        return rows

    def _of(self, i: int, t: float, states: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        at, own = self._at[i], states[self.net.places[i]]
        return lambda inputs: np.asarray(at.outputs(t, own, inputs), dtype=float).reshape(-1)

    def _tick(
        self, t: float, x: np.ndarray, q: np.ndarray, before: Rows, u: np.ndarray, flags: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, Rows]:
        """Held values and sampled states after an update, and the outputs of all parts."""
        answers: list[Any] = []
        for i, part in enumerate(self.net.parts):
            if part.group is None:
                answers.append(None if self.net.earlier else self._of(i, t, x))
            else:
                answers.append(self._of(i, t, q) if flags[part.group] > 0.25 else None)
        inputs, outputs = self._settle([row.copy() for row in before], answers, u)
        h, fresh = np.array([outputs[i][j] for i, j in self.net.held]), q.copy()
        for i, part in enumerate(self.net.parts):
            if part.group is not None and part.nstates and flags[part.group] > 0.75:
                place = self.net.places[i]
                fresh[place] = np.reshape(self._at[i].rates(t, q[place], inputs[i]), -1)
        if not np.all(np.isfinite(np.concatenate([h, fresh]))):
            raise Diverged(not_finite(self.net, fresh, h, t))
        return h, fresh, outputs

    def _settle(
        self, outputs: Rows, answers: Sequence[Any], u: np.ndarray
    ) -> tuple[list[np.ndarray], Rows]:
        """Inputs and outputs at one instant; parts in ``answers`` respond to their inputs."""
        inputs: list[Any] = [None] * len(outputs)
        for _ in range(sum(map(len, outputs)) + 2):
            changed = False
            for i, part in enumerate(self.net.parts):
                new = np.array([self._signal(k, outputs, u) for k in part.inputs], dtype=float)
                if inputs[i] is None or new.tobytes() != inputs[i].tobytes():
                    inputs[i], changed = new, True
                    if answers[i] is not None:
                        outputs[i] = answers[i](new)
            if not changed:
                return inputs, outputs
        if not all(np.isfinite(row).all() for row in outputs):
            return inputs, outputs  # 0 * inf never settles; it is reported by name later
        return self._solved(inputs, outputs, answers, u)

    def _solved(
        self, inputs: Rows, outputs: Rows, answers: Sequence[Any], u: np.ndarray
    ) -> tuple[list[np.ndarray], Rows]:
        """The same for outputs that depend on themselves."""
        ends = np.cumsum([len(row) for row in inputs])[:-1]

        def through(flat: np.ndarray) -> Rows:
            given = zip(np.split(flat, ends), answers, outputs, strict=True)
            return [out if a is None else a(row) for row, a, out in given]

        def step(flat: np.ndarray) -> np.ndarray:
            rows = through(flat)
            labels = [k for part in self.net.parts for k in part.inputs]
            return np.array([self._signal(k, rows, u) for k in labels], dtype=float)

        owners = [i for i, row in enumerate(inputs) for _ in row]
        try:
            key = hash(tuple(a is None for a in answers))
            flat = settled_values(step, np.concatenate(inputs), owners, self._loops, key)
        except Unsolved as error:
            raise AlgebraicLoop(self.net.loop_message(error.blocks)) from None
        return np.split(flat, ends), through(flat)

    def _signal(self, label: str, outputs: Rows, u: np.ndarray) -> float:
        if label in self.net.outside:
            return u[self.net.outside.index(label)]
        return sum(outputs[i][j] for i, j in self.net.sources[label])

    def _signals(self, outputs: Rows, h: np.ndarray) -> np.ndarray:
        """All signals; the sampled ones after the update."""
        if self.net.alone:
            return outputs[0]
        rows = [row.copy() for row in outputs]
        for (i, j), value in zip(self.net.held, h, strict=True):
            rows[i][j] = value
        none = np.zeros(len(self.net.outside))
        return np.array([self._signal(label, rows, none) for label in self.net.signals])

    def _advance(self, course: Course, accuracy: Accuracy) -> Advance:
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
            return self._by_scipy(t, rows, x, course.hold, given), np.nan

        return called

    def _by_scipy(
        self, t: np.ndarray, rows: np.ndarray, x: np.ndarray, hold: bool, given: Any
    ) -> np.ndarray:
        m = len(self.net.outside)
        slope = 0.0 * rows[:, 0] if hold else (rows[:, 1] - rows[:, 0]) / (t[1] - t[0])

        def rates(now: float, state: np.ndarray) -> np.ndarray:
            u = rows[:, 0] + (now - t[0]) * slope
            if self.net.alone:
                return self._at[0].rates(now, state, u)
            outputs = self._outputs(now, state, u[m:], u[:m])
            parts = zip(self.net.parts, self._at, self.net.places, strict=True)
            return np.concatenate(
                [
                    np.reshape(at.rates(now, state[place], self._inputs(part, outputs, u)), -1)
                    for part, at, place in parts
                    if not part.sampled and part.nstates
                ]
            )

        done = solve_ivp(rates, t, x, **given)
        last = done.y[:, -1]
        if not done.success or not np.isfinite(last).all():
            labels, looped = self.net.states(sampled=False), self.net.looped
            raise stopped(self.net.name, labels, done.t[-1], last, done.message, looped=looped)
        return last

    def _inputs(self, part: Any, outputs: Rows, u: np.ndarray) -> np.ndarray:
        return np.array([self._signal(k, outputs, u) for k in part.inputs])
