"""One run of a traced system with error control and located events."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.errors import InputError
from ..codegen.adaptive_step import adaptive_code
from ..codegen.outputs import output_code
from ..tracing.equations import Program
from .backend import compiler, kind_of, load, load_steps
from .course import Accuracy, Course, Now, Track
from .endings import no_bound


@dataclass(frozen=True)
class Run:
    """States (n, N) at the grid points, the number of trial steps, and the last time at which
    the error test was given up because a relay did not come to rest (nan: never)."""

    states: np.ndarray
    steps: int
    unsettled: float


def chosen_backend() -> str:
    """What runs a single system here: "c" or "numba" where there is one, else "python"."""
    return compiler() or "python"


class Adaptive:
    """Compiled adaptive run and outputs of a program, with a backend of "c", "numba" or "python";
    None: the first one available."""

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
        shape = (len(self.program.states), len(t))
        status = np.append([0.0, 0.0, 0.0, np.nan, 0.0], [] if sizes is None else sizes)
        arguments = [np.require(a, float, ["C", "W"]) for a in (t, u, x0, p)]
        grid, inputs, start, values = arguments
        accuracy = float(rtol), Accuracy(rtol, atol).floor
        if self.backend != "python":
            states = np.empty(shape)
            good = self._run(grid, inputs, bool(hold), start, values, *accuracy, states, status)
        else:
            grid, inputs, start, values = (a.tolist() for a in arguments)
            lists = [[0.0] * shape[1] for _ in range(shape[0])]
            good = self._run(grid, inputs, bool(hold), start, values, *accuracy, lists, status)
            states = np.array(lists).reshape(shape)
        if not good:
            raise no_bound(self.program.name, self.program.states, status)
        if sizes is not None:
            sizes[:] = status[5:]
        return Run(states, int(status[4]), float(status[3]))

    def part(
        self, course: Course, now: Now, p: np.ndarray, accuracy: Accuracy
    ) -> tuple[list[np.ndarray], float]:
        """A part of a run from ``now``, which is moved to its end: at the kept points the
        continuous states, the sampled ones, the held values after and before the update; and
        when a sign did not settle."""
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
        """The track that starts at the continuous states x and the sampled ones q.

        Raises Diverged, with the state, or the sampled block and its output or state, and the time.
        """
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
        y = np.empty((len(self.program.outputs), len(t)))
        with np.errstate(all="ignore"):
            self._outputs(t, x, u, p, y)
        return y


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
        """The run, ready to use; fast after the first call. Of a program it reads only the labels.

        A worker compiles with what it has, which may be another compiler.
        """
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
