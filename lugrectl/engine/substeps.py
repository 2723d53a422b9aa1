"""One sample of a continuous system: whether its rates are affine, and the step where not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .adaptive_run import Accuracy, Called, Course, Engine, warn_unsettled
from .graph import Node, TraceError, affine
from .memo import ALONE, described
from .tracer import Net, is_number, traced_net

ERROR = Accuracy(1e-6)  # allowed in a substep, relative to the largest value of each state


class Substeps:
    """A continuous system over one sample, in substeps of at most ``longest`` s.

    Whether the rates are affine in the states is decided by the traced equations, with all inputs
    and parameters as symbols; a function that cannot be traced counts as not affine.
    """

    def __init__(self, system: Any, longest: float) -> None:
        self.system, self.longest = system, longest
        self._solvers: dict[Any, tuple[bool, Engine | Called]] = {}
        self._last: tuple[Any, Any] = (None, None)

    def again(self) -> None:
        """A run begins: what a function of the user reads from outside may have changed."""
        if described(self.system, by_trace=False) is None:
            self._solvers.clear()
            self._last = (None, None)

    def affine(self, params: Mapping[str, Any]) -> bool:
        """Whether the rates are affine in the states, at any inputs."""
        return self._solver(params)[0]

    def _solver(self, params: Mapping[str, Any]) -> tuple[bool, Engine | Called]:
        own = {k: params[k] for k in self.system.params if k in params}
        numbers = {k: v for k, v in own.items() if not isinstance(v, Node)}
        key = tuple((k, v if is_number(v) else id(v)) for k, v in numbers.items())
        if key not in self._solvers:
            with ALONE:
                self._solvers[key] = self._traced(numbers)
        is_affine, solver = self._solvers[key]
        if isinstance(solver, Engine) and {*solver.program.fixed} & {*own} - {*numbers}:
            raise TraceError(
                "a parameter decides which equations there are: it is needed as a number"
            )
        return is_affine, solver

    def _traced(self, numbers: Mapping[str, Any]) -> tuple[bool, Engine | Called]:
        net = Net.of(self.system)
        try:
            hybrid = traced_net(net, numbers)
            hybrid.check()
        except TraceError:
            return False, Called(net, numbers, "LSODA")
        flow = replace(hybrid.flow, outputs=(), y=())  # the states alone are asked for
        return None not in affine(flow.xdot, flow.x), Engine(replace(hybrid, flow=flow))

    def step(
        self, x: np.ndarray, before: np.ndarray, now: np.ndarray, params: Mapping[str, Any]
    ) -> np.ndarray:
        """The states after a sample, from the time and the inputs at its start and its end."""
        _, solver = self._solver(params)
        asked = (id(solver), x.tobytes(), before.tobytes(), now.tobytes())
        if self._last[0] != asked:  # output and update of a block ask for the same step
            count = int(np.ceil((now[0] - before[0]) / self.longest - 1e-9))
            grid = before[:, None] + (now - before)[:, None] * (np.arange(count + 1) / count)
            given = Course.along(grid[0], grid[1:], 0, False), x, np.zeros(0)
            if isinstance(solver, Engine):
                own = {k: v for k, v in params.items() if k in self.system.params}
                track = solver.follow(*given, solver.program.arguments(own), ERROR)
            else:
                track = solver.follow(*given, ERROR)
            warn_unsettled(self.system.name, track.unsettled, 1)
            self._last = asked, track.x[:, -1]
        return self._last[1].copy()
