"""One run of a traced net: flow with error control and located events, and sampled updates."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.errors import Diverged, InputError
from ..codegen.adaptive_step import adaptive_code, held_code, output_code, signal_code
from ..tracing.network import Net
from ..tracing.tracer import Hybrid, Program
from .backend import compiler, kind_of, load, load_steps
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
    """The times at which a net is stepped, the updates there, and the points to keep.

    ``grid`` (N,) are updates and requested times, ``given`` (m, N) the external inputs, which
    ``hold`` holds between grid points. ``flags`` (groups, N) are 1 for an update of a sample time,
    0.5 if only its outputs are requested. ``column`` (N,) is the place among the kept points, -1:
    not kept; None: all are kept.
    """

    grid: np.ndarray
    given: np.ndarray
    flags: np.ndarray
    column: np.ndarray | None
    hold: bool

    @classmethod
    def along(cls, t: np.ndarray, u: np.ndarray, groups: int, hold: bool) -> Course:
        """Return a course with updates of all sample times at each time, all of them kept."""
        return cls(t, u, np.ones((groups, len(t))), None, hold)

    @property
    def ticks(self) -> np.ndarray:
        return np.asarray((self.flags > 0.0).any(axis=0))

    @property
    def columns(self) -> np.ndarray:
        return np.arange(len(self.grid)) if self.column is None else self.column

    @property
    def kept(self) -> Any:
        """The kept points, as an index of the grid."""
        return slice(None) if self.column is None else np.flatnonzero(self.column >= 0)


@dataclass(frozen=True)
class Track:
    """Continuous states, sampled states and signals at the kept points; ``unsettled`` is the last
    time at which the error test was given up because a relay did not come to rest (nan: never)."""

    x: np.ndarray
    q: np.ndarray
    y: np.ndarray
    unsettled: float


@dataclass(frozen=True)
class Now:
    """Where a run is: continuous and sampled states, held values, and sizes (``Adaptive.run``)."""

    x: np.ndarray
    q: np.ndarray
    h: np.ndarray
    sizes: np.ndarray

    @classmethod
    def start(cls, x: np.ndarray, q: np.ndarray, held: int) -> Now:
        return cls(x.copy(), q.copy(), np.zeros(held), np.zeros(3 * len(x)))

    def copy(self) -> Now:
        return Now(self.x.copy(), self.q.copy(), self.h.copy(), self.sizes.copy())


@dataclass(frozen=True)
class Run:
    """States (n, N), the number of trial steps, and ``unsettled`` as in :class:`Track`."""

    states: np.ndarray
    steps: int
    unsettled: float


def chosen_backend() -> str:
    """What runs a single system here: "c" or "numba" where there is one, else "python"."""
    return compiler() or "python"


class Adaptive:
    """Compiled adaptive run and outputs of a program; ``backend`` None: the first one available."""

    backend: Any
    hybrid: Any = None  # the equations of a net
    held = 0  # values between updates

    def __init__(self, program: Program, backend: str | None = None) -> None:
        self.backend = backend or chosen_backend()
        code = adaptive_code(program, kind_of(self.backend)), output_code(program)
        self._load(program, *code)

    def _load(self, program: Any, run_code: str, output_code: str) -> None:
        self.program = program
        self._run = load_steps(run_code, self.backend).run
        self._outputs = load(output_code, "numpy").outputs

    def of(self, hybrid: Any) -> Any:
        """The same code for equations of the same outline, which may have other defaults."""
        other = copy(self)
        other.hybrid, other.program = hybrid, hybrid.flow
        return other

    def run(
        self,
        t: np.ndarray,
        u: np.ndarray,
        x0: np.ndarray,
        p: np.ndarray,
        *,
        hold: bool,
        rtol: float,
        atol: float | None = None,
        sizes: np.ndarray | None = None,
    ) -> Run:
        """States at the times t (N,) for inputs u (m, N), held or linear between them.

        The error of each step is at most ``rtol``: the states' errors, each divided by the
        state's size, as the root of the sum of their squares. The size is the largest value of
        the last swing, which is forgotten in about the time in which the state fell (at least
        ``atol / rtol``, default 1e-9, and 1e-7 of its largest value so far). ``sizes`` (3 n,)
        carries the sizes from one part of a run to the next: zeros before the first. Raises
        Diverged, with state and time.
        """
        states = np.empty((len(self.program.states), len(t)))
        status = np.append([0.0, 0.0, 0.0, np.nan, 0.0], [] if sizes is None else sizes)
        given = (t, u, bool(hold), x0, p, float(rtol), Accuracy(rtol, atol).floor)
        if not _call(self._run, self.backend, given, [states], status):
            raise no_bound(self.program.name, self.program.states, status)
        if sizes is not None:
            sizes[:] = status[5:]
        return Run(states, int(status[4]), float(status[3]))

    def part(
        self, course: Course, now: Now, p: np.ndarray, accuracy: Accuracy
    ) -> tuple[list[np.ndarray], float]:
        """The rows of a part of a run from ``now``, which is moved to its end; ``unsettled``."""
        states, unsettled, none = now.x[:, None], np.nan, np.empty((0, len(course.grid)))
        if len(now.x) and len(course.grid) > 1:
            options = {"hold": course.hold, "rtol": accuracy.rtol, "atol": accuracy.atol}
            run = self.run(course.grid, course.given, now.x, p, **options, sizes=now.sizes)
            states, unsettled = run.states, run.unsettled
            now.x[:] = states[:, -1]
        return [states if len(states) else none, none, none, none], unsettled

    def follow(
        self, course: Course, x: np.ndarray, q: np.ndarray, p: np.ndarray, accuracy: Accuracy
    ) -> Track:
        """The track that starts at the continuous states x and the sampled ones q."""
        kept, now = course.kept, Now.start(x, q, self.held)
        (states, before, h, b), unsettled = self.part(course, now, p, accuracy)
        given = course.given[:, kept]
        y = self.signals(
            course.grid[kept], states, np.vstack([given, h]) if len(h) else given, b, p
        )
        return Track(states, before, y, unsettled)

    def signals(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, b: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        """All outputs (k, N) for states x, inputs and held values u, held values before b."""
        return self.outputs(t, x, u, p)

    def outputs(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        return self._filled(self._outputs, t, x, u, p)

    def _filled(self, function: Any, t: np.ndarray, *given: np.ndarray) -> np.ndarray:
        y = np.empty((len(self.program.outputs), len(t)))
        with np.errstate(all="ignore"):
            function(t, *given, y)
        return y


def _call(
    run: Any, backend: str, given: Sequence[Any], filled: Sequence[np.ndarray], status: np.ndarray
) -> int:
    """Call generated code that fills arrays; with lists in plain Python, where they are faster."""
    form = np.ndarray.tolist if backend == "python" else _laid_out
    given = [form(a) if isinstance(a, np.ndarray) else a for a in given]
    if backend != "python":
        return run(*given, *filled, status)
    lists = [a.tolist() for a in filled]
    code = run(*given, *lists, status)
    for target, rows in zip(filled, lists, strict=True):
        target[...] = np.array(rows).reshape(target.shape)
    return code


def _laid_out(values: np.ndarray) -> np.ndarray:
    return np.require(values, float if values.dtype.kind == "f" else np.int64, ["C", "W"])


@dataclass(frozen=True)
class Portable:
    """The generated code of an adaptive run, with its labels; always picklable.

    Functions of a user may not pickle, and expression graphs are deep. A worker needs only the
    code: it compiles it, or loads its machine code from the cache on disk.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    backend: str
    run_code: str
    output_code: str

    @classmethod
    def of(cls, engine: Adaptive, outputs: Sequence[str] | None = None) -> Portable:
        """The code of a compiled system; ``outputs``: only these are computed."""
        program = chosen_outputs(engine.program, outputs)
        labels = program.name, program.states, program.inputs, program.outputs
        run_code = adaptive_code(program, kind_of(engine.backend))
        return cls(*labels, engine.backend, run_code, output_code(program))

    def loaded(self) -> Adaptive:
        """The run, compiled with what a worker has; of a program it reads only labels."""
        engine = Adaptive.__new__(Adaptive)
        engine.backend = self.backend if self.backend == "python" else compiler() or self.backend
        engine._load(self, self.run_code, self.output_code)
        return engine


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
    """Compiled run and signals of a net; ``backend`` None: plain Python up to FEW points."""

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
        given = (course.grid, course.given, course.ticks, course.flags, columns, bool(course.hold))
        given = (*given, p, float(accuracy.rtol), accuracy.floor)
        backend, run = self._chosen(len(course.grid))
        code = _call(run, backend, given, [now.x, now.q, now.h, *out], status)
        now.sizes[:] = status[5:]
        if code == 1:
            raise no_bound(net.name, self.program.states, status)
        if code == 2:
            raise Diverged(not_finite(net, now.q, now.h, status[1]))
        return out, float(status[3])

    def signals(
        self, t: np.ndarray, x: np.ndarray, u: np.ndarray, b: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        return self._filled(self._signals, t, x, u, b, p)

    def _chosen(self, points: int) -> tuple[str, Any]:
        """The backend for so many more points, and the generated function."""
        self._points += points
        few = FEW if self.program.x else 25 * FEW
        backend = self.backend or (self._points > few and compiler()) or "python"
        backend = "python" if getattr(_HERE, "plain", False) else backend
        if backend not in self._runs:
            assert self.hybrid.tick is not None
            text = held_code(self.hybrid, self.hybrid.tick, kind_of(backend))
            self._runs[backend] = load_steps(text, backend).alternate
        return backend, self._runs[backend]


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
