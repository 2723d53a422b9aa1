"""A compiled run of a net of continuous and sampled blocks."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...core.errors import Diverged
from ..codegen.sampled_data import held_code, signal_code
from ..tracing.network import Net
from ..tracing.tracer import Hybrid
from .adaptive_run import Adaptive
from .backend import compiler, kind_of, load, load_steps
from .course import Accuracy, Course, Now
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


class Held(Adaptive):
    """Compiled run and signals of a net, with a backend of "c", "numba" or "python"; None: plain
    Python for up to FEW grid points, because compiling would take longer than running."""

    def __init__(self, hybrid: Hybrid, backend: str | None = None) -> None:
        self.hybrid, self.program, self.held = hybrid, hybrid.flow, len(hybrid.net.held)
        self.backend, self._points = backend, 0
        self._runs: dict[str, Any] = {}
        self._signals = load(signal_code(hybrid), "numpy").signals

    def part(
        self, course: Course, now: Now, p: np.ndarray, accuracy: Accuracy
    ) -> tuple[list[np.ndarray], float]:
        net, columns = self.hybrid.net, course.columns
        counts = (len(now.x), len(now.q), self.held, self.held if net.earlier else 0)
        out = [np.empty((count, np.count_nonzero(columns >= 0))) for count in counts]
        status = np.append([0.0, 0.0, 0.0, np.nan, 0.0], now.sizes)
        fixed = (course.grid, course.given, course.ticks, course.flags, columns)
        given = (*fixed, course.hold, p, float(accuracy.rtol), accuracy.floor)
        code = self._call(given, [now.x, now.q, now.h], out, status)
        now.sizes[:] = status[5:]
        if code == 1:
            raise no_bound(net.name, self.program.states, status)
        if code == 2:
            raise Diverged(not_finite(net, now.q, now.h, status[1]))
        return out, float(status[3])

    def signals(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, b: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        y = np.empty((len(self.program.outputs), len(t)))
        with np.errstate(all="ignore"):
            self._signals(t, x, u, b, p, y)
        return y

    def _chosen(self, points: int) -> str:
        if getattr(_HERE, "plain", False):
            return "python"
        self._points += points
        few = FEW if self.program.x else 25 * FEW
        return self.backend or (self._points > few and compiler()) or "python"

    def _call(self, fixed: Any, now: Any, out: Any, status: np.ndarray) -> int:
        """Call the generated function; with lists in plain Python, where they are faster."""
        *arrays, hold, p, rtol, floor = fixed
        backend = self._chosen(len(arrays[0]))
        if backend not in self._runs:
            assert self.hybrid.tick is not None
            text = held_code(self.hybrid, self.hybrid.tick, kind_of(backend))
            self._runs[backend] = load_steps(text, backend).alternate
        run = self._runs[backend]
        if backend != "python":
            arrays = [_plain(a) for a in (*arrays, p)]
            return run(*arrays[:-1], bool(hold), arrays[-1], rtol, floor, *now, *out, status)
        arrays, lists, kept = ([a.tolist() for a in group] for group in (arrays, now, out))
        code = run(*arrays, bool(hold), p.tolist(), rtol, floor, *lists, *kept, status)
        for target, rows in zip([*now, *out], [*lists, *kept], strict=True):
            target[...] = np.array(rows).reshape(target.shape)
        return code


def _plain(values: np.ndarray) -> np.ndarray:
    kind = float if values.dtype.kind == "f" else np.int64
    return np.require(values, kind, ["C", "W"])


def not_finite(net: Net, q: np.ndarray, h: np.ndarray, t: float) -> str:
    """The sampled block with an output or a state that is not a number."""
    what = "a sampled signal is not a number"
    states = [
        (f"state {label} of block {part.block.name}", value)
        for part, place in zip(net.parts, net.places, strict=True)
        if part.sampled
        for label, value in zip(part.block.state_labels or (), q[place], strict=False)
    ]
    parts = [(net.parts[i], j) for i, j in net.held]
    outputs = [f"output {part.outputs[j]} of block {part.block.name}" for part, j in parts]
    for label, value in [*zip(outputs, h, strict=True), *states]:
        if not np.isfinite(value):
            what = f"{label} is {value}"
            break
    return f"{net.name}: {what} at t = {t:.6g} s."
