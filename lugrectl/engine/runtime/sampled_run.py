"""A compiled run of a net of continuous and sampled blocks."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.errors import Diverged
from ..codegen.sampled_data import held_code, signal_code
from ..tracing.network import Net
from ..tracing.network_equations import Hybrid
from .adaptive_run import floor_of
from .backend import compiler, kind_of, load, load_steps

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


@dataclass(frozen=True)
class Course:
    """The times at which a net is stepped, the updates there, and the points to keep.

    Parameters
    ----------
    grid : (N,) ndarray
        Times of updates and requested times.
    given : (m, N) ndarray
        External inputs.
    flags : (groups, N) ndarray
        1 for an update of a sample time, 0.5 if only its outputs are requested.
    column : (N,) ndarray of int
        Index among the kept points, -1: not kept.
    hold : bool
        Inputs are held between grid points.
    """

    grid: np.ndarray
    given: np.ndarray
    flags: np.ndarray
    column: np.ndarray
    hold: bool

    @property
    def ticks(self) -> np.ndarray:
        return np.asarray((self.flags > 0.0).any(axis=0))

    @property
    def kept(self) -> np.ndarray:
        return np.flatnonzero(self.column >= 0)


@dataclass(frozen=True)
class Track:
    """Continuous states, sampled states and signals at the kept points; ``unsettled`` as in
    :class:`lugrectl.engine.runtime.adaptive_run.Run`."""

    x: np.ndarray
    q: np.ndarray
    y: np.ndarray
    unsettled: float


@dataclass(frozen=True)
class Now:
    """Where a run is: continuous states, sampled states, held values, and the sizes of the
    continuous states (``Adaptive.run``)."""

    x: np.ndarray
    q: np.ndarray
    h: np.ndarray
    sizes: np.ndarray

    @classmethod
    def start(cls, hybrid: Hybrid, x: np.ndarray, q: np.ndarray) -> Now:
        return cls(x.copy(), q.copy(), np.zeros(len(hybrid.net.held)), np.zeros(3 * len(x)))

    def copy(self) -> Now:
        return Now(self.x.copy(), self.q.copy(), self.h.copy(), self.sizes.copy())


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

    def of(self, hybrid: Hybrid) -> Held:
        """The same code for equations of the same outline, which may have other defaults."""
        made = copy(self)
        made.hybrid = hybrid
        return made

    def _chosen(self, points: int) -> str:
        if getattr(_HERE, "plain", False):
            return "python"
        self._points += points
        few = FEW if self.hybrid.flow.x else 25 * FEW
        return self.backend or (self._points > few and compiler()) or "python"

    def run(
        self,
        course: Course,
        x: np.ndarray,
        q: np.ndarray,
        p: np.ndarray,
        rtol: float,
        atol: float | None = None,
    ) -> Track:
        """The track that starts at the states x, q.

        Raises
        ------
        Diverged
            Names the state, or the sampled block and its output or state, and the time.
        """
        now = Now.start(self.hybrid, x, q)
        kept, (states, before, h, b), unsettled = (
            course.kept,
            *self.part(course, now, p, rtol, atol),
        )
        y = self.signals(course.grid[kept], states, np.vstack([course.given[:, kept], h]), b, p)
        return Track(states, before, y, unsettled)

    def part(
        self, course: Course, now: Now, p: np.ndarray, rtol: float, atol: float | None
    ) -> tuple[list[np.ndarray], float]:
        """A part of a run from ``now``, which is moved to its end: at the kept points the
        continuous states, the sampled ones, the held values after and before the update; and
        when a sign did not settle. Raises as :meth:`run` does."""
        net, kept = self.hybrid.net, course.kept
        many = len(now.h)
        counts = (len(now.x), len(now.q), many, many if net.earlier else 0)
        out = [np.empty((count, len(kept))) for count in counts]
        status = np.append([0.0, 0.0, 0.0, np.nan, 0.0], now.sizes)
        fixed = (course.grid, course.given, course.ticks, course.flags, course.column)
        accuracy = (float(rtol), floor_of(rtol, atol))
        backend = self._chosen(len(course.grid))
        code = self._call(
            backend, (*fixed, course.hold, p, *accuracy), [now.x, now.q, now.h], out, status
        )
        now.sizes[:] = status[5:]
        if code == 1:
            label = self.hybrid.flow.states[int(status[2])]
            raise Diverged(
                f"{net.name}: state {label} grows without bound, is not a number, or changes "
                f"faster than steps can follow, at t = {status[1]:.6g} s."
            )
        if code == 2:
            raise Diverged(not_finite(net, now.q, now.h, status[1]))
        return out, float(status[3])

    def signals(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, b: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        """All signals (k, N) for states x, inputs and held values u, held values before b."""
        y = np.empty((len(self.hybrid.y), len(t)))
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
