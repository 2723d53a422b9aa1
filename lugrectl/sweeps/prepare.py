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
from ..engine.runtime.memo import compiled
from ..engine.tracing.network import Net
from ..engine.tracing.tracer import widths
from ..simulation import arguments
from ..simulation.block_list import net_of
from . import parameter_table
from .worker import OneByOne, Plan, Task, Traced

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
            index = range(first, min(first + size, self.count))
            here = slice(index.start, index.stop)
            starts = self.x0[here] if len(self.x0) > 1 else np.repeat(self.x0, len(index), axis=0)
            seeds = None if self.seeds is None else self.seeds[here]
            views = {k: v[here] for k, v in places.items() if v is not None}
            yield Task(index, self.p(index), starts, seeds, **views)

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


@dataclass(frozen=True)
class Asked:
    """What :func:`lugrectl.sweep` is asked to simulate, as it was given."""

    system: Any
    t: ArrayLike
    inputs: Any
    params: Any
    x0: Any
    seeds: Any
    outputs: Sequence[str] | None
    states: bool | Sequence[str]
    hold: bool
    rtol: float
    reduce: Callable[..., Any] | None


def prepare(asked: Asked) -> Prepared:
    """Check the arguments and trace the system. Raises InputError."""
    rtol, reduce, inputs = arguments.settings(asked.rtol, asked.hold), asked.reduce, asked.inputs
    times, columns = arguments.times(asked.t), parameter_table.columns(asked.params)
    net, _ = net_of(asked.system)
    blocks = [part.block for part in net.parts]
    if reduce is not None and not callable(reduce):
        raise InputError(f"reduce must be a function of t and y, not {shown(reduce)}.")
    if not callable(inputs):
        inputs = arguments.inputs(net.name, net.outside, times, inputs)
    starts, drawn = _starts(net, asked.x0), _seeds(asked.seeds, inputs)
    lengths = dict([("params", len(v)) for v in columns.values() if v.ndim][:1])
    lengths |= {"x0": len(starts)} if len(starts) != 1 else {}
    lengths |= {} if drawn is None else {"seeds": len(drawn)}
    count = parameter_table.members(lengths)
    wanted, chosen = _chosen(net, "output", asked.outputs), asked.states
    kept = _chosen(net, "state", None if chosen is True else [] if chosen is False else chosen)
    full = {k: np.ascontiguousarray(np.broadcast_to(v, (count,))) for k, v in columns.items()}
    for key, values in full.items():
        numbers = values[~np.isnan(values)]  # a member that is NaN fails alone
        for value in {numbers.min(), numbers.max()} if len(numbers) else ():
            arguments.parameters(blocks, {key: value})
    system = blocks[0] if net.alone else list(asked.system)
    solver, rows = _solver(
        net, OneByOne(system, tuple(full), wanted, times, asked.hold, rtol), full
    )
    keep = tuple(net.states().index(k) for k in kept) if kept else None
    shape = (len(wanted), len(times))
    plan = Plan(solver, net.name, net.outside, inputs, keep, reduce, shape, rows.names, times)
    carried = isinstance(solver, Traced)
    return Prepared(plan, times, wanted, kept, full, starts, rows, drawn, count, carried)


def _chosen(net: Net, what: str, names: Sequence[str] | str | None) -> tuple[str, ...]:
    """The names of outputs or states (``what``), all for None; InputError if one is unknown."""
    has = net.signals if what == "output" else net.states()
    try:
        chosen = tuple(has if names is None else [names] if isinstance(names, str) else names)
    except TypeError:
        raise InputError(f"{what}s must be a list of names, not {shown(names)}.") from None
    unknown = [name for name in chosen if name not in has]
    if unknown:
        there = ", ".join(has) or "none"
        raise InputError(f"{net.name} has no {what} '{unknown[0]}'; it has {there}.")
    return chosen


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
    net: Net, alone: OneByOne, columns: Mapping[str, np.ndarray]
) -> tuple[Traced | OneByOne, _Rows]:
    """By generated code where a continuous system has some, else member by member."""
    if not net.groups:
        try:
            engine, fixed = _engine(net, columns)
            keys, defaults = engine.program.keys, engine.program.arguments(fixed)
            places = {i: columns[k] for i, k in enumerate(keys) if k in columns}
            p = defaults.copy()
            for at, values in places.items():
                p[at] = np.nanmax(values, initial=-np.inf)
            # generated code alone cannot keep the past of a dead time
            if not any(delay > 0.0 for delay in lates(engine.program, p).values()):
                portable = Portable.of(engine, alone.outputs)
                made = Traced(portable, alone.t, alone.hold, alone.rtol)
                return made, _Rows(tuple(keys), defaults, places)
        except TraceError as error:
            warnings.warn(
                f"{error}; the members are simulated one by one in this process, traced "
                "separately if possible, else by LSODA.",
                RuntimeWarning,
                stacklevel=4,
            )
    return alone, _Rows(alone.names, np.zeros(len(columns)), dict(enumerate(columns.values())))


def _engine(net: Net, columns: Mapping[str, np.ndarray]) -> tuple[Adaptive, dict[str, float]]:
    """The compiled system, and the values that replaced defaults when it was traced.

    It is traced with the system's own defaults first; then with the first member's values, for
    keys without a default and for those needed as numbers. Of the width of a sign the largest
    value decides whether the sign is smooth.
    """
    keys = [k for part in net.parts for k in widths(part.block) if k in columns]
    wide = {k: float(np.nanmax(columns[k])) for k in keys}
    first = {k: float(v[0]) for k, v in columns.items()} | wide
    for given in (wide, first):
        try:
            engine = compiled(net, given)
        except (TraceError, KeyError):  # a block reads a key that has no default
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
                    f"{net.name}: parameter {changing[0]} changes the equations themselves"
                )
    raise TraceError(f"{net.name}: cannot be traced with the parameters {', '.join(first)}")


def _starts(net: Net, x0: Any) -> np.ndarray:
    try:
        rows: Any = array(0.0 if x0 is None else x0, "x0")
    except InputError:  # parts, as python-control takes them
        rows = np.zeros(1)
    many = len(net.states())
    if rows.ndim != 2:
        return arguments.start(net.name, many, x0)[None]
    if rows.shape[1] != many:
        raise InputError(f"x0 has the shape {rows.shape}; {net.name} needs (members, {many}).")
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
