"""A compiled run of a net of continuous and sampled blocks."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from .adaptive import Diverged
from .held_code import held_code, signal_code
from .hybrid import Hybrid
from .load import has_numba, load
from .net import Net

FEW = 2000  # grid points; 25 times as many where nothing flows between ticks


@dataclass(frozen=True)
class Course:
    """The times at which a net is stepped, what happens there and what is kept.

    Parameters
    ----------
    grid : (N,) ndarray
        Ticks and wanted times.
    given : (m, N) ndarray
        Inputs from outside.
    flags : (groups, N) ndarray
        1 where a sample time ticks, 0.5 where its outputs alone are wanted.
    column : (N,) ndarray of int
        Place among the kept points, -1: not kept.
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
    :class:`lugrectl.engine.adaptive.Run`."""

    x: np.ndarray
    q: np.ndarray
    y: np.ndarray
    unsettled: float


class Held:
    """Compiled run and signals of a net.

    Parameters
    ----------
    hybrid : Hybrid
        The equations of the net, as ``trace_net`` gives them.
    backend : str or None
        "numba", "python", or None: plain Python for the first FEW grid points, where compiling
        would take far longer than running, then numba where it can be imported.
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
        self._points += points
        few = FEW if self.hybrid.flow.x else 25 * FEW
        return self.backend or ("numba" if self._points > few and has_numba() else "python")

    def run(
        self, course: Course, x: np.ndarray, q: np.ndarray, p: np.ndarray, rtol: float
    ) -> Track:
        """The track from the states x, q on.

        Raises
        ------
        Diverged
            Names the state, or the sampled block and its output or state, and the time.
        """
        net, kept = self.hybrid.net, course.kept
        counts = (len(x), len(q), len(net.held), len(net.held) if net.earlier else 0)
        out = [np.empty((count, len(kept))) for count in counts]
        now = [x.copy(), q.copy(), np.zeros(len(net.held))]
        status = np.array([0.0, 0.0, 0.0, np.nan, 0.0])
        fixed = (course.grid, course.given, course.ticks, course.flags, course.column)
        backend = self._chosen(len(course.grid))
        code = self._call(backend, (*fixed, course.hold, p, rtol), now, out, status)
        if code == 1:
            label = self.hybrid.flow.states[int(status[2])]
            raise Diverged(
                f"{net.name}: state {label} grows without bound, is not a number, or changes "
                f"faster than steps can follow, at t = {status[1]:.6g} s."
            )
        if code == 2:
            raise Diverged(not_finite(net, now[1], now[2], status[1]))
        y = np.empty((len(net.signals), len(kept)))
        u = np.vstack([course.given[:, kept], out[2]])
        with np.errstate(all="ignore"):
            self._signals(course.grid[kept], out[0], u, out[3], p, y)
        return Track(out[0], out[1], y, float(status[3]))

    def _generated(self, backend: str) -> Any:
        if backend not in self._runs:
            assert self.hybrid.tick is not None
            text = held_code(self.hybrid, self.hybrid.tick, backend)
            self._runs[backend] = load(text, backend).alternate
        return self._runs[backend]

    def _call(self, backend: str, fixed: Any, now: Any, out: Any, status: np.ndarray) -> int:
        """The generated function; plain Python is quicker on lists."""
        run = self._generated(backend)
        *arrays, hold, p, rtol = fixed
        if backend == "numba":
            arrays = [np.require(a, requirements=["C", "W"]) for a in (*arrays, p)]
            return run(*arrays[:-1], bool(hold), arrays[-1], float(rtol), *now, *out, status)
        arrays, lists, kept = ([a.tolist() for a in group] for group in (arrays, now, out))
        code = run(*arrays, bool(hold), p.tolist(), float(rtol), *lists, *kept, status)
        for targets, values in ((now, lists), (out, kept)):
            for target, rows in zip(targets, values, strict=True):
                target[...] = np.array(rows).reshape(target.shape)
        return code


def not_finite(net: Net, q: np.ndarray, h: np.ndarray, t: float) -> str:
    """Which sampled block put out, or holds as a state, what is no number."""
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
