"""The work of one worker: some members, one after the other; failures are stored."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.errors import Diverged, InputError
from ..core.jobs import JobError
from ..engine.runtime.adaptive_run import Portable
from ..engine.runtime.course import Accuracy, Course
from ..engine.runtime.endings import bounded, first_bad
from ..simulation import arguments
from ..simulation.response import simulate

Answer = tuple[np.ndarray, np.ndarray, float]  # states, outputs, unsettled time
Solve = Callable[[np.ndarray, np.ndarray, np.ndarray], Answer]  # of inputs (m, N), x0, p


@dataclass(frozen=True)
class Traced:
    """Simulates by generated code; plain data."""

    portable: Portable
    t: np.ndarray
    hold: bool
    rtol: float

    def ready(self) -> Solve:
        loaded, name, none = self.portable.loaded(), self.portable.name, np.zeros(0)
        labels, accuracy = [f"output {k}" for k in self.portable.outputs], Accuracy(self.rtol)

        def solve(u: np.ndarray, x0: np.ndarray, p: np.ndarray) -> Answer:
            course = Course.along(self.t, u, 0, self.hold)
            track = loaded.follow(course, x0, none, p, accuracy)
            bad = first_bad(self.t, track.y)
            if bad is not None:
                raise Diverged(f"{name}: {labels[bad[0]]} is {bad[2]}")
            bounded(name, self.t, [track.y], lambda: [labels], [u, x0], looped=False)
            return track.x, track.y, track.unsettled

        return solve


@dataclass(frozen=True)
class OneByOne:
    """Simulates by ``simulate``, for systems without portable code; stays in this process."""

    system: Any
    names: tuple[str, ...]  # of the parameters
    outputs: tuple[str, ...]
    t: np.ndarray
    hold: bool
    rtol: float

    def ready(self) -> Solve:
        return self.solve

    def solve(self, u: np.ndarray, x0: np.ndarray, p: np.ndarray) -> Answer:
        params = dict(zip(self.names, p.tolist(), strict=True)) or None
        options: dict[str, Any] = {"hold": self.hold, "rtol": self.rtol, "squeeze": False}
        with warnings.catch_warnings():  # the warning was given once for all members
            warnings.simplefilter("ignore", RuntimeWarning)
            response = simulate(self.system, self.t, u, x0, params=params, **options)
        states = response.states
        states = np.empty((0, len(self.t))) if states is None else np.atleast_2d(states)
        labels = list(response.output_labels or ())
        rows = [labels.index(name) for name in self.outputs]
        return states, np.asarray(response.outputs)[rows], np.nan


@dataclass(frozen=True)
class Plan:
    """The data common to all members."""

    solver: Traced | OneByOne
    name: str
    labels: tuple[str, ...]  # of the inputs
    inputs: Any  # (m, N), or a function
    keep: tuple[int, ...] | None  # rows of the requested states
    reduce: Callable[[np.ndarray, np.ndarray], Any] | None
    shape: tuple[int, int]  # outputs, samples
    parameters: tuple[str, ...]
    t: np.ndarray


@dataclass(frozen=True)
class Task:
    """The data of the members ``index``: (c, q) parameters, (c, n) initial states, seeds.

    ``y`` and ``x``, if given, are arrays for the answers of a worker in this process.
    """

    index: range
    p: np.ndarray
    x0: np.ndarray
    seeds: Sequence[Any] | None
    y: np.ndarray | None = None
    x: np.ndarray | None = None


@dataclass(frozen=True)
class Block:
    """The answers to a task; rows of failed members are nan (``reduced``: None)."""

    index: range
    y: np.ndarray | None
    x: np.ndarray | None
    reduced: list[Any] | None
    failed: dict[int, str] = field(default_factory=dict)
    coarse: dict[int, float] = field(default_factory=dict)


def work(plan: Plan, task: Task) -> Block:
    """Simulate all members of a task."""
    solve, count, samples = plan.solver.ready(), len(task.index), plan.shape[1]
    y, x = task.y, task.x
    if y is None and plan.reduce is None:
        y = np.empty((count, *plan.shape))
    if x is None and plan.keep is not None:
        x = np.empty((count, len(plan.keep), samples))
    block = Block(task.index, y, x, None if plan.reduce is None else [None] * count)
    for row, member in enumerate(task.index):
        try:
            _member(plan, task, block, row, solve)
        except Exception as error:  # of the member or of a user's function: stored, not raised
            block.failed[member] = JobError.of(member, error).sentence
            for part in (y, x):
                if part is not None:
                    part[row] = np.nan
    return block


def _member(plan: Plan, task: Task, block: Block, row: int, solve: Any) -> None:
    bad = np.flatnonzero(np.isnan(task.p[row]))
    if len(bad):
        raise InputError(f"parameter {plan.parameters[bad[0]]} is nan.")
    if not np.all(np.isfinite(task.x0[row])):
        raise InputError("x0 is not finite.")
    u = plan.inputs
    if callable(u):
        with _named("inputs"):
            own = task.index[row]  # with seeds random numbers depend on the member's seed only
            given = u(own if task.seeds is None else np.random.default_rng(task.seeds[row]))
            u = arguments.inputs(plan.name, plan.labels, plan.t, given)
    states, y, unsettled = solve(u, task.x0[row], task.p[row])
    if block.reduced is not None and plan.reduce is not None:
        with _named("reduce"):
            block.reduced[row] = np.asarray(plan.reduce(plan.t, y), dtype=float)
    if block.y is not None:
        block.y[row] = y
    if block.x is not None and plan.keep is not None:
        block.x[row] = states[list(plan.keep)]
    if np.isfinite(unsettled):
        block.coarse[task.index[row]] = float(unsettled)


@contextlib.contextmanager
def _named(what: str) -> Iterator[None]:
    """Name the user's function that failed."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{what}: {JobError.of(0, error).sentence}") from error
