"""One run of a traced net: flow with error control and located events, and sampled updates."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...core.errors import Diverged, InputError
from ..codegen.adaptive_step import run_code
from ..tracing.network import Net
from ..tracing.tracer import Hybrid, Program
from .backend import call, compiler, kind_of, laid_out, load_steps
from .endings import no_bound


@dataclass(frozen=True)
class Accuracy:
    """The error allowed in a step: relative to the size of a state, and near zero in its unit."""

    rtol: float
    atol: float | None = None

    @property
    def floor(self) -> float:
        """The value of a state below which its error is absolute."""
        return 1e-9 if self.atol is None else float(self.atol) / float(self.rtol)

    @property
    def scipy(self) -> dict[str, float]:
        """The options of ``solve_ivp``."""
        return {"rtol": self.rtol, "atol": 1e-4 * self.rtol if self.atol is None else self.atol}


@dataclass(frozen=True)
class Course:
    """The times ``grid`` (N,) at which a net is stepped, the external inputs ``given`` (m, N), the
    updates ``flags`` (groups, N) of :class:`Hybrid`, and the places to keep."""

    grid: np.ndarray
    given: np.ndarray
    flags: np.ndarray
    hold: bool
    kept: Any = field(default_factory=lambda: slice(None))

    @classmethod
    def along(cls, t: np.ndarray, u: np.ndarray, groups: int, hold: bool) -> Course:
        """Return a course with updates of all sample times at each time, all of them kept."""
        return cls(t, u, np.ones((groups, len(t))), hold)

    @property
    def ticks(self) -> np.ndarray:
        return np.asarray((self.flags > 0.0).any(axis=0))


@dataclass(frozen=True)
class Track:
    """Continuous states, sampled states before the updates, and signals at the grid points;
    ``unsettled`` is the last time at which a relay did not come to rest (nan: never)."""

    x: np.ndarray
    q: np.ndarray
    y: np.ndarray
    unsettled: float = np.nan
    steps: int = 0

    def at(self, kept: Any) -> Track:
        """The track at these grid points."""
        return replace(self, x=self.x[:, kept], q=self.q[:, kept], y=self.y[:, kept])


@dataclass(frozen=True)
class Now:
    """Where a run is: continuous and sampled states, held values, and sizes (``Engine.run``)."""

    x: np.ndarray
    q: np.ndarray
    h: np.ndarray
    sizes: np.ndarray

    @classmethod
    def start(cls, x: Any, q: Any, held: int) -> Now:
        x, q = np.array(x, dtype=float), np.array(q, dtype=float)
        return cls(x, q, np.zeros(held), np.zeros(3 * len(x)))

    def copy(self) -> Now:
        return Now(self.x.copy(), self.q.copy(), self.h.copy(), self.sizes.copy())


def chosen_backend() -> str:
    """What runs a single system here: "c" or "numba" where there is one, else "python"."""
    return compiler() or "python"


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


class Engine:
    """The generated run of a net; always picklable without its equations (:meth:`portable`).

    ``backend`` None: plain Python up to FEW points, then the first one available.
    """

    def __init__(self, hybrid: Hybrid, backend: str | None = None) -> None:
        self.hybrid, self.backend = hybrid, backend
        self.net, self.name, self.outputs = hybrid.net, hybrid.net.name, hybrid.flow.outputs
        self.states, self.held = hybrid.flow.states, len(hybrid.net.held) if hybrid.ticked else 0
        self._points = 0
        self._code: dict[str, str] = {}
        self._runs: dict[str, Any] = {}

    @property
    def program(self) -> Program:
        return self.hybrid.flow

    def of(self, hybrid: Hybrid) -> Engine:
        """The same code for equations of the same outline, which may have other defaults."""
        other = Engine(hybrid, self.backend)
        other._code, other._runs = self._code, self._runs
        return other

    def portable(self) -> Engine:
        """The code alone: functions of a user may not pickle, and expression graphs are deep."""
        self._text(kind_of(self.backend or "python"))
        other = object.__new__(Engine)
        other.__dict__ |= {
            k: v for k, v in vars(self).items() if k not in ("hybrid", "net", "_runs")
        }
        return other

    def loaded(self) -> Engine:
        """A portable run, compiled with what a worker has: its machine code is in the cache."""
        if self.backend != "python":
            self.backend = compiler() or self.backend
        self._runs = {}
        return self

    def _text(self, kind: str) -> str:
        if kind not in self._code:
            self._code[kind] = run_code(self.hybrid, kind)
        return self._code[kind]

    def run(self, course: Course, now: Now, p: np.ndarray, accuracy: Accuracy) -> Track:
        """The track from ``now``, which is moved to its end; Diverged with state and time."""
        backend = self._chosen(len(course.grid))
        if backend not in self._runs:
            self._runs[backend] = load_steps(self._text(kind_of(backend)), backend).run
        counts = len(now.x), len(now.q), len(self.outputs)
        x, q, y = (np.empty((count, len(course.grid))) for count in counts)
        status = np.array([0.0, 0.0, 0.0, np.nan, 0.0])
        given = (course.grid, course.given, course.ticks, course.flags, bool(course.hold))
        given = (*given, p, float(accuracy.rtol), accuracy.floor)
        filled = [now.x, now.q, now.h, now.sizes, x, q, y, status]
        code = call(self._runs[backend], backend, laid_out(given, backend), filled)
        if code == 1:
            raise no_bound(self.name, self.states, status)
        if code == 2:
            raise Diverged(not_finite(self.net, now.q, now.h, status[1]))
        return Track(x, q, y, float(status[3]), int(status[4]))

    def follow(
        self, course: Course, x: np.ndarray, q: np.ndarray, p: np.ndarray, accuracy: Accuracy
    ) -> Track:
        """The track at the kept points from the continuous states x and the sampled ones q."""
        return self.run(course, Now.start(x, q, self.held), p, accuracy).at(course.kept)

    def _chosen(self, points: int) -> str:
        """The backend for so many more points."""
        if self.backend is not None:
            return self.backend
        self._points += points
        few = FEW if self.states else 25 * FEW
        plain = getattr(_HERE, "plain", False) or self._points <= few
        return "python" if plain else compiler() or "python"


def chosen_outputs(program: Program, outputs: Sequence[str] | None) -> Program:
    """The program with these outputs alone, in this order; None: all."""
    if outputs is None:
        return program
    unknown = [name for name in outputs if name not in program.outputs]
    if unknown:
        has = ", ".join(program.outputs) or "none"
        raise InputError(f"{program.name} has no output '{unknown[0]}'; it has {has}.")
    y = tuple(program.y[program.outputs.index(name)] for name in outputs)
    return replace(program, outputs=tuple(outputs), y=y)


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
