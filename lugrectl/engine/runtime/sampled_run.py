"""A compiled run of a net of continuous and sampled blocks."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from copy import copy
from typing import Any

import numpy as np

from ...core.errors import Diverged
from ..codegen.sampled_data import held_code, signal_code
from ..tracing.equations import Program
from ..tracing.network import Net
from ..tracing.tracer import Hybrid
from .backend import compiler, kind_of, load, load_steps
from .course import Accuracy, Course, Now, Track
from .endings import no_bound

_HERE = threading.local()
FEW = 2000  # grid points; 25 times as many if there are no continuous states


@contextlib.contextmanager
def interpreted() -> Iterator[None]:
    """Nets that this thread runs meanwhile stay in plain Python: for short runs of many nets."""
    before, _HERE.plain = getattr(_HERE, "plain", False), True
    try:
        yield
    finally:
        _HERE.plain = before


class Held:
    """Compiled run and signals of a net.

    Parameters
    ----------
    hybrid : Hybrid
        The equations of the net, as ``trace_net`` gives them.
    backend : str or None
        "c", "numba", "python", or None: plain Python for up to FEW grid points, because compiling
        would take longer than running; beyond that "c" or "numba", whichever is there.
    """

    def __init__(self, hybrid: Hybrid, backend: str | None = None) -> None:
        self.hybrid = hybrid
        self.backend, self._points = backend, 0
        self._runs: dict[str, Any] = {}
        self._signals = load(signal_code(self.hybrid), "numpy").signals

    @property
    def flow(self) -> Program:
        return self.hybrid.flow

    def of(self, hybrid: Hybrid) -> Held:
        """The same code for equations of the same outline, which may have other defaults."""
        made = copy(self)
        made.hybrid = hybrid
        return made

    def _chosen(self, points: int) -> str:
        if getattr(_HERE, "plain", False):
            return "python"
        self._points += points
        few = FEW if self.flow.x else 25 * FEW
        return self.backend or (self._points > few and compiler()) or "python"

    def follow(
        self, course: Course, x: np.ndarray, q: np.ndarray, p: np.ndarray, accuracy: Accuracy
    ) -> Track:
        """The track that starts at the states x, q.

        Raises
        ------
        Diverged
            Names the state, or the sampled block and its output or state, and the time.
        """
        kept, now = course.kept, Now.start(x, q, len(self.hybrid.net.held))
        (states, before, h, b), unsettled = self.part(course, now, p, accuracy)
        u = np.vstack([course.given[:, kept], h])
        y = self.signals(course.grid[kept], states, u, b, p)
        return Track(states, before, y, unsettled)

    def part(
        self, course: Course, now: Now, p: np.ndarray, accuracy: Accuracy
    ) -> tuple[list[np.ndarray], float]:
        """A part of a run from ``now``, which is moved to its end: at the kept points the
        continuous states, the sampled ones, the held values after and before the update; and
        when a sign did not settle. Raises as :meth:`follow` does."""
        net, many = self.hybrid.net, len(now.h)
        counts = (len(now.x), len(now.q), many, many if net.earlier else 0)
        columns = course.columns
        out = [np.empty((count, np.count_nonzero(columns >= 0))) for count in counts]
        status = np.append([0.0, 0.0, 0.0, np.nan, 0.0], now.sizes)
        fixed = (course.grid, course.given, course.ticks, course.flags, columns)
        given = (*fixed, course.hold, p, float(accuracy.rtol), accuracy.floor)
        code = self._call(self._chosen(len(course.grid)), given, [now.x, now.q, now.h], out, status)
        now.sizes[:] = status[5:]
        if code == 1:
            raise no_bound(net.name, self.flow.states, status)
        if code == 2:
            raise Diverged(not_finite(net, now.q, now.h, status[1]))
        return out, float(status[3])

    def signals(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, b: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        """All signals (k, N) for states x, inputs and held values u, held values before b."""
        y = np.empty((len(self.flow.outputs), len(t)))
        with np.errstate(all="ignore"):
            self._signals(t, x, u, b, p, y)
        return y

    def _generated(self, backend: str) -> Any:
        if backend not in self._runs:
            assert self.hybrid.tick is not None
            text = held_code(self.hybrid, self.hybrid.tick, kind_of(backend))
            self._runs[backend] = load_steps(text, backend).alternate
        return self._runs[backend]

    def _call(self, backend: str, fixed: Any, now: Any, out: Any, status: np.ndarray) -> int:
        """Call the generated function; with lists in plain Python, where they are faster."""
        run = self._generated(backend)
        *arrays, hold, p, rtol, floor = fixed
        if backend != "python":
            arrays = [np.require(_number(a), requirements=["C", "W"]) for a in (*arrays, p)]
            return run(*arrays[:-1], bool(hold), arrays[-1], rtol, floor, *now, *out, status)
        arrays, lists, kept = ([a.tolist() for a in group] for group in (arrays, now, out))
        code = run(*arrays, bool(hold), p.tolist(), rtol, floor, *lists, *kept, status)
        for targets, values in ((now, lists), (out, kept)):
            for target, rows in zip(targets, values, strict=True):
                target[...] = np.array(rows).reshape(target.shape)
        return code


def _number(values: np.ndarray) -> np.ndarray:
    return values.astype(float if values.dtype.kind == "f" else np.int64, copy=False)


def not_finite(net: Net, q: np.ndarray, h: np.ndarray, t: float) -> str:
    """The sampled block with an output or a state that is not a number."""
    for (i, j), value in zip(net.held, h, strict=True):
        if not np.isfinite(value):
            part = net.parts[i]
            return (
                f"{net.name}: output {part.outputs[j]} of block {part.block.name} is {value} at "
                f"t = {t:.6g} s."
            )
    for part, place in zip(net.parts, net.places, strict=True):
        for label, value in zip(part.block.state_labels or (), q[place], strict=False):
            if part.sampled and not np.isfinite(value):
                return (
                    f"{net.name}: state {label} of block {part.block.name} is {value} at "
                    f"t = {t:.6g} s."
                )
    return f"{net.name}: a sampled signal is not a number at t = {t:.6g} s."
