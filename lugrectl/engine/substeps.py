"""One sample of a continuous system: whether its rates are affine, and the step where not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ..core.errors import Diverged
from .adaptive_run import Accuracy, Course, Engine, Now, warn_unsettled
from .backend import compiler
from .graph import Node, TraceError, affine
from .memo import ALONE, described, is_number
from .tracer import Hybrid, Net, traced_net

RTOL = 1e-6  # error allowed in a substep, relative to the largest value of each state
FEW = 4000  # samples; compiling takes as long as so many in plain Python
SIZES = 10.0 ** np.arange(-6, 7)  # of the states at which a function without a trace is tried
CLOSE = 1e-9


@dataclass
class _Kind:
    """What is known of the rates while the parameters in ``fixed`` have these values."""

    fixed: Mapping[str, Any]
    affine: bool
    hybrid: Hybrid | None
    engines: dict[str, Engine] = field(default_factory=dict)
    calls: int = 0

    def engine(self, hybrid: Hybrid) -> Engine:
        self.calls += 1
        backend = (self.calls > FEW and compiler()) or "python"
        if backend not in self.engines:
            self.engines[backend] = Engine(hybrid, backend)
        return self.engines[backend]


class Substeps:
    """A continuous system over one sample, in substeps of at most ``longest`` s.

    Whether the rates are affine in the states is decided by the traced equations, with all
    parameters and inputs as symbols. A function that cannot be traced is tried at states from
    1e-6 to 1e6 and at other parameters; a point without a finite value does not count.
    """

    def __init__(self, system: Any, longest: float) -> None:
        self.system, self.longest = system, longest
        self._kinds: list[_Kind] = []
        self._last: tuple[Any, Any] = (None, None)

    def again(self) -> None:
        """A run begins: what a function of the user reads from outside may have changed."""
        if described(self.system, by_trace=False) is None:
            self._kinds.clear()
            self._last = (None, None)

    def affine(self, params: Mapping[str, Any]) -> bool:
        """Whether the rates are affine in the states, at any inputs."""
        return self._kind(params).affine

    def _kind(self, params: Mapping[str, Any]) -> _Kind:
        for known in self._kinds:
            given = [(params[k], v) for k, v in known.fixed.items()]
            if any(isinstance(one, Node) for one, _ in given):
                raise TraceError(
                    "a parameter decides which equations there are: it is needed as a number"
                )
            if all(one is other or np.array_equal(one, other) for one, other in given):
                return known
        own = {
            k: v for k, v in params.items() if k in self.system.params and not isinstance(v, Node)
        }
        with ALONE:
            try:
                hybrid = traced_net(Net.of(self.system), own)
                hybrid.check()
            except TraceError:
                made = _Kind({}, affine_by_probes(self.system), None)
            else:
                flow = replace(hybrid.flow, outputs=(), y=())  # the states alone are asked for
                hybrid = replace(hybrid, flow=flow)
                fixed = {k: v for k, v in own.items() if k in flow.fixed or not is_number(v)}
                made = _Kind(fixed, None not in affine(flow.xdot, flow.x), hybrid)
        self._kinds.append(made)
        return self._kind(params) if any(isinstance(v, Node) for v in params.values()) else made

    def step(
        self, x: np.ndarray, before: np.ndarray, now: np.ndarray, params: Mapping[str, Any]
    ) -> np.ndarray:
        """The states after a sample, from the time and the inputs at its start and its end."""
        own = {k: v for k, v in params.items() if k in self.system.params}
        kind = self._kind(own)
        values = tuple(v if is_number(v) else id(v) for v in own.values())
        asked = (id(kind), x.tobytes(), before.tobytes(), now.tobytes(), values)
        if self._last[0] == asked:  # output and update of a block ask for the same step
            return self._last[1].copy()
        count = int(np.ceil((now[0] - before[0]) / self.longest - 1e-9))
        grid = before[:, None] + (now - before)[:, None] * (np.arange(count + 1) / count)
        if kind.hybrid is None:
            after = self._by_scipy(x, grid, own)
        else:
            engine, p = kind.engine(kind.hybrid), kind.hybrid.flow.arguments(own)
            course, moved = Course.along(grid[0], grid[1:], 0, False), Now.start(x, [], 0)
            run = engine.run(course, moved, p, Accuracy(RTOL))
            warn_unsettled(self.system.name, run.unsettled, 1)
            after = moved.x
        self._last = asked, after
        return after.copy()

    def _by_scipy(self, x: np.ndarray, grid: np.ndarray, own: Mapping[str, Any]) -> np.ndarray:
        t, inputs = grid[0], grid[1:]

        def rates(now: float, state: np.ndarray) -> Any:
            u = np.array([np.interp(now, t, row) for row in inputs])
            return np.reshape(self.system.updfcn(now, state, u, own), -1)

        options = {"method": "LSODA", "rtol": RTOL, "atol": 1e-4 * RTOL, "max_step": self.longest}
        done = solve_ivp(rates, (t[0], t[-1]), x, **options)
        last = done.y[:, -1]
        if not done.success or not np.all(np.isfinite(last)):
            bad = int(np.argmax(~np.isfinite(last)))
            raise Diverged(
                f"{self.system.name}: state {self.system.state_labels[bad]} cannot be continued "
                f"at t = {done.t[-1]:.6g} s: {done.message}"
            )
        return last


def affine_by_probes(system: Any) -> bool:
    """Whether f(a + b) + f(0) = f(a) + f(b) wherever it is finite, and that is somewhere."""
    random, seen, variants = np.random.default_rng(0), False, [dict(system.params)]
    for size in (0.3, 3.0, 30.0):  # all numbers changed
        numbers = {k: v for k, v in system.params.items() if is_number(v)}
        moved = {k: v * (1.0 + size * random.random()) for k, v in numbers.items()}
        shifted = {k: v if v else size * random.standard_normal() for k, v in moved.items()}
        variants += [{**system.params, **shifted}] if numbers else []
    for params in variants:
        for size in np.repeat(SIZES, 4):
            u = random.standard_normal(system.ninputs) * 10.0 ** random.uniform(-3.0, 3.0)
            u = np.abs(u) if random.random() < 0.5 else u
            a, b = size * random.standard_normal((2, system.nstates))
            t = abs(random.standard_normal())
            try:
                with np.errstate(all="ignore"):
                    parts = [system.updfcn(t, x, u, params) for x in (a + b, 0.0 * a, a, b)]
                values = np.array([np.reshape(np.asarray(p, dtype=float), -1) for p in parts])
            except (ArithmeticError, ValueError, RuntimeError):
                continue
            if not np.isfinite(values).all():
                continue
            values = values * np.array([[1.0], [1.0], [-1.0], [-1.0]])
            scale = np.abs(values).max(axis=0) + 1e-300
            if not np.all(np.abs(values.sum(axis=0)) <= CLOSE * scale):
                return False
            seen = True
    return seen
