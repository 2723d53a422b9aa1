"""Checks the arguments of a sweep and makes a plan and tasks of them."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import InputError
from ..core.validation import array, shown
from ..engine.expression.numpy_protocol import TraceError
from ..engine.runtime.adaptive_run import Adaptive, Portable
from ..engine.runtime.delays import lates
from ..engine.runtime.memo import compiled_system
from ..engine.tracing.tracer import widths
from ..simulation import arguments
from . import parameter_table
from .member import Face
from .worker import OneByOne, Plan, Solver, Task, Traced

_BLOCK = 32e6  # bytes of results in one task, about
_MOST = 256  # members in one task


@dataclass(frozen=True)
class Prepared:
    """A sweep that is ready to run. ``carried``: whether it can be sent to other processes."""

    plan: Plan
    t: np.ndarray
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    params: Mapping[str, np.ndarray]  # (L,) each
    x0: np.ndarray  # (L, n), or (1, n) for all
    p: Callable[[range], np.ndarray]
    seeds: Sequence[Any] | None
    count: int
    carried: bool

    def tasks(self, size: int, places: Mapping[str, Any]) -> Iterator[Task]:
        """All members in tasks; ``places``: arrays for ``y`` and ``x`` of all members, if any."""
        for first in range(0, self.count, size):
            yield self._task(range(first, min(first + size, self.count)), places)

    def _task(self, index: range, places: Mapping[str, Any]) -> Task:
        here = slice(index.start, index.stop)
        starts = self.x0[here] if len(self.x0) > 1 else np.repeat(self.x0, len(index), axis=0)
        seeds = None if self.seeds is None else [_sequence(s) for s in self.seeds[here]]
        views = {k: v[here] for k, v in places.items() if v is not None}
        return Task(index, self.p(index), starts, seeds, **views)

    def chunk(self, workers: int) -> int:
        """Members in a task: at least four tasks for each worker, and bounded memory."""
        rows = len(self.states) + (0 if self.plan.reduce else len(self.outputs))
        fitting = int(_BLOCK / (8 * len(self.t) * max(rows, 1)))
        return max(1, min(fitting, _MOST, -(-self.count // (4 * workers))))


@dataclass(frozen=True)
class _Spawned(Sequence[Any]):
    """The children 0 .. count - 1 of one seed, made on request."""

    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, at: Any) -> Any:
        if isinstance(at, slice):
            return [self[i] for i in range(*at.indices(self.count))]
        return np.random.SeedSequence(0, spawn_key=(at,))


def prepare(
    system: Any,
    t: ArrayLike,
    inputs: Any,
    params: Any,
    x0: Any,
    seeds: Any,
    outputs: Sequence[str] | None,
    states: bool | Sequence[str],
    hold: bool,
    rtol: float,
    reduce: Callable[..., Any] | None,
) -> Prepared:
    """Check the arguments and trace the system. Raises InputError."""
    rtol = arguments.settings(rtol, hold)
    times, columns, face = arguments.times(t), parameter_table.columns(params), Face.of(system)
    if reduce is not None and not callable(reduce):
        raise InputError(f"reduce must be a function of t and y, not {shown(reduce)}.")
    given = inputs
    if not callable(inputs):
        given = arguments.inputs(face.name, face.inputs, times, inputs)
    starts, drawn = _starts(face, x0), _seeds(seeds, inputs)
    count = parameter_table.members(_lengths(columns, starts, drawn))
    wanted = face.chosen("output", outputs)
    kept = face.chosen("state", None if states is True else [] if states is False else states)
    full = {k: np.ascontiguousarray(np.broadcast_to(v, (count,))) for k, v in columns.items()}
    blocks = face.system if isinstance(face.system, list) else [face.system]
    for key, values in full.items():
        numbers = values[~np.isnan(values)]  # a member that is NaN fails alone
        for value in {numbers.min(), numbers.max()} if len(numbers) else ():
            arguments.parameters(blocks, {key: value})
    solver, rows = _solver(face, times, wanted, full, hold, rtol)
    keep = tuple(face.states.index(k) for k in kept) if kept else None
    shape = (len(wanted), len(times))
    plan = Plan(solver, face.name, face.inputs, given, keep, reduce, shape, rows.names, times)
    carried = isinstance(solver, Traced)
    return Prepared(plan, times, wanted, kept, full, starts, rows, drawn, count, carried)


def sendable(prepared: Prepared, executor: Executor | None, processes: bool) -> None:
    """Raise InputError at once if a function cannot be sent to another process."""
    if not (processes or isinstance(executor, ProcessPoolExecutor)):
        return
    for what in ("inputs", "reduce"):
        try:
            pickle.dumps(getattr(prepared.plan, what))
        except Exception as error:
            raise InputError(
                f"{what} cannot be sent to another process ({error}); "
                "define the function at the top of a module."
            ) from None


@dataclass(frozen=True)
class _Rows:
    """Parameter rows (c, q) for a range of members: defaults, replaced by the table's columns."""

    names: tuple[str, ...]
    defaults: np.ndarray
    columns: Mapping[int, np.ndarray]

    def __call__(self, index: range) -> np.ndarray:
        rows = np.repeat(self.defaults[None], len(index), axis=0)
        for at, values in self.columns.items():
            rows[:, at] = values[index.start : index.stop]
        return rows


def _solver(
    face: Face,
    t: np.ndarray,
    outputs: tuple[str, ...],
    columns: Mapping[str, np.ndarray],
    hold: bool,
    rtol: float,
) -> tuple[Solver, _Rows]:
    system = face.system
    if not face.sampled:
        try:
            engine, fixed = _engine(system, columns)
            portable = Portable.of(engine, outputs)
            keys, defaults = engine.program.keys, engine.program.arguments(fixed)
            places = {i: columns[k] for i, k in enumerate(keys) if k in columns}
            if _late(engine, defaults, places):
                return _one_by_one(system, face, t, outputs, columns, hold, rtol)
            return Traced(portable, t, hold, rtol), _Rows(tuple(keys), defaults, places)
        except TraceError as error:
            warnings.warn(
                f"{error}; the members are simulated one by one in this process, traced "
                "separately if possible, else by LSODA.",
                RuntimeWarning,
                stacklevel=4,
            )
    return _one_by_one(system, face, t, outputs, columns, hold, rtol)


def _late(engine: Adaptive, defaults: np.ndarray, columns: Mapping[int, np.ndarray]) -> bool:
    """Whether some member has a dead time: its past is kept, which generated code cannot."""
    p = defaults.copy()
    for at, values in columns.items():
        p[at] = np.nanmax(values, initial=-np.inf)
    return any(delay > 0.0 for delay in lates(engine.program, p).values())


def _one_by_one(
    system: Any,
    face: Face,
    t: np.ndarray,
    outputs: tuple[str, ...],
    columns: Mapping[str, np.ndarray],
    hold: bool,
    rtol: float,
) -> tuple[Solver, _Rows]:
    names = tuple(columns)
    rows = _Rows(names, np.zeros(len(names)), dict(enumerate(columns.values())))
    places = tuple(face.outputs.index(name) for name in outputs)
    return OneByOne(system, names, places, t, hold, rtol), rows


def _engine(system: Any, columns: Mapping[str, np.ndarray]) -> tuple[Adaptive, dict[str, float]]:
    """The compiled system, and the values that replaced defaults when it was traced.

    It is traced with the system's own defaults first; then with the first member's values, for
    keys without a default and for those needed as numbers. Of the width of a sign the largest
    value decides whether the sign is smooth.
    """
    wide = {k: float(np.nanmax(columns[k])) for k in widths(system) if k in columns}
    first = {k: float(v[0]) for k, v in columns.items()} | wide
    for given in (wide, first):
        try:
            engine = compiled_system(system, given)
        except TraceError:
            if given == first:
                raise
            continue
        except KeyError:  # a block reads a key that has no default
            if given == first:
                raise
            continue
        program = engine.program
        same = {k: v for k, v in program.fixed.items() if k in columns}
        if set(columns) <= {*program.keys, *same}:
            changing = [k for k, v in same.items() if np.any(columns[k] != v)]
            if not changing:
                return engine, given
            if given == first:
                raise TraceError(
                    f"{system.name}: parameter {changing[0]} changes the equations themselves"
                )
    raise TraceError(f"{system.name}: cannot be traced with the parameters {', '.join(first)}")


def _starts(face: Face, x0: Any) -> np.ndarray:
    try:
        rows: Any = array(0.0 if x0 is None else x0, "x0")
    except InputError:  # parts, as python-control takes them
        rows = np.zeros(1)
    if rows.ndim != 2:
        return arguments.start(face.name, len(face.states), 0.0 if x0 is None else x0)[None]
    if rows.shape[1] != len(face.states):
        raise InputError(
            f"x0 has the shape {rows.shape}; {face.name} needs (members, {len(face.states)})."
        )
    return np.array(rows)


def _seeds(seeds: Any, inputs: Any) -> Sequence[Any] | None:
    if seeds is None:
        return None
    if not callable(inputs):
        raise InputError("seeds are for random inputs: give inputs as a function of a Generator.")
    if np.ndim(seeds) == 0 and np.issubdtype(np.asarray(seeds).dtype, np.integer):
        return _Spawned(max(int(seeds), 0))
    try:
        return [s if isinstance(s, np.random.SeedSequence) else int(s) for s in seeds]
    except (TypeError, ValueError):
        raise InputError("seeds must be a number of members or a list of whole numbers.") from None


def _sequence(seed: Any) -> Any:
    return seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)


def _lengths(columns: Mapping[str, np.ndarray], x0: np.ndarray, seeds: Any) -> dict[str, int]:
    whole = {"params": [len(v) for v in columns.values() if v.ndim]}
    whole["x0"] = [len(x0)] if len(x0) != 1 else []
    whole["seeds"] = [] if seeds is None else [len(seeds)]
    return {what: found[0] for what, found in whole.items() if found}
