"""The members of a sweep: what is asked is checked once, then each worker simulates some."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import Diverged, InputError
from ..core.jobs import JobError
from ..core.validation import array, shown
from ..engine.expression.numpy_protocol import TraceError
from ..engine.runtime.adaptive_run import Accuracy, Course, Engine
from ..engine.runtime.delays import lates
from ..engine.runtime.endings import bounded, first_bad
from ..engine.runtime.memo import compiled
from ..engine.tracing.network import Net
from ..engine.tracing.tracer import widths
from . import arguments
from .net_run import net_of
from .response import simulate

_FORMS = "a dict of columns, a list of dicts, a structured array or a DataFrame"
_BLOCK = 32e6  # bytes of results in one task, about
_MOST = 256  # members in one task

Answer = tuple[np.ndarray, np.ndarray, float]  # states, outputs, unsettled time
Solve = Callable[[np.ndarray, np.ndarray, np.ndarray], Answer]  # of inputs (m, N), x0, p


@dataclass(frozen=True)
class Traced:
    """Simulates by generated code; plain data."""

    portable: Engine
    rows: tuple[int, ...]  # of the outputs
    t: np.ndarray
    hold: bool
    rtol: float

    def ready(self) -> Solve:
        loaded, name, none = self.portable.loaded(), self.portable.name, np.zeros(0)
        labels = [f"output {self.portable.outputs[i]}" for i in self.rows]
        rows, accuracy = list(self.rows), Accuracy(self.rtol)

        def solve(u: np.ndarray, x0: np.ndarray, p: np.ndarray) -> Answer:
            course = Course.along(self.t, u, 0, self.hold)
            track = loaded.follow(course, x0, none, p, accuracy)
            y = track.y[rows]
            bad = first_bad(self.t, y)
            if bad is not None:
                raise Diverged(f"{name}: {labels[bad[0]]} is {bad[2]}")
            bounded(name, self.t, [y], lambda: [labels], [u, x0], looped=False)
            return track.x, y, track.unsettled

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
    """The data common to all members: all that a worker needs."""

    solver: Traced | OneByOne
    name: str
    labels: tuple[str, ...]  # of the inputs
    inputs: Any  # (m, N), or a function
    keep: tuple[int, ...] | None  # rows of the requested states
    reduce: Callable[[np.ndarray, np.ndarray], Any] | None
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    t: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.outputs), len(self.t)

    @property
    def carried(self) -> bool:
        """Whether it can be sent to other processes."""
        return isinstance(self.solver, Traced)


@dataclass(frozen=True)
class Task:
    """Members: (c, q) parameters, (c, n) initial states, seeds, and places of the answers."""

    index: range
    p: np.ndarray
    x0: np.ndarray
    seeds: Sequence[Any] | None
    y: np.ndarray | None = None
    x: np.ndarray | None = None


@dataclass(frozen=True)
class Block:
    """The answers to a task; rows of failed members are nan (``reduced``: None)."""

    y: np.ndarray | None
    x: np.ndarray | None
    reduced: list[Any] | None
    failed: dict[int, str] = field(default_factory=dict)
    coarse: dict[int, float] = field(default_factory=dict)


def work(plan: Plan, task: Task) -> Block:
    """Simulate all members of a task."""
    solve, count, y, x = plan.solver.ready(), len(task.index), task.y, task.x
    if y is None and plan.reduce is None:
        y = np.empty((count, *plan.shape))
    if x is None and plan.keep is not None:
        x = np.empty((count, len(plan.keep), len(plan.t)))
    block = Block(y, x, None if plan.reduce is None else [None] * count)
    for row, member in enumerate(task.index):
        try:
            _simulate_member(plan, task, block, row, solve)
        except Exception as error:  # of the member or of a user's function: stored, not raised
            block.failed[member] = JobError.of(member, error).sentence
            for part in (y, x):
                if part is not None:
                    part[row] = np.nan
    return block


def _simulate_member(plan: Plan, task: Task, block: Block, row: int, solve: Solve) -> None:
    p, x0, u = task.p[row], task.x0[row], plan.inputs
    if np.isnan(p).any():
        raise InputError(f"parameter {plan.parameters[int(np.argmax(np.isnan(p)))]} is nan.")
    if not np.all(np.isfinite(x0)):
        raise InputError("x0 is not finite.")
    if callable(u):
        with _named("inputs"):  # with seeds random numbers depend on the member's seed only
            seeds = task.seeds
            given = u(task.index[row] if seeds is None else np.random.default_rng(seeds[row]))
            u = arguments.inputs(plan.name, plan.labels, plan.t, given)
    states, y, unsettled = solve(u, x0, p)
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


@dataclass(frozen=True)
class Prepared:
    """A sweep that is ready to run."""

    plan: Plan
    states: tuple[str, ...]
    params: Mapping[str, np.ndarray]  # (L,) each
    x0: np.ndarray  # (L, n), or (1, n) for all
    defaults: np.ndarray  # of the solver's parameters
    columns: Mapping[int, np.ndarray]  # the values in place of them
    seeds: int | Sequence[Any] | None  # a number of generators spawned from one seed, or each seed
    count: int

    @property
    def compiled(self) -> bool:
        """Whether other threads run beside a member."""
        solver = self.plan.solver
        return isinstance(solver, Traced) and solver.portable.backend != "python"

    def tasks(self, size: int, places: Mapping[str, np.ndarray]) -> Iterator[Task]:
        """All members in tasks; ``places``: arrays for ``y`` and ``x`` of all members, if any."""
        for first in range(0, self.count, size):
            index = range(first, min(first + size, self.count))
            here, seeds = slice(index.start, index.stop), self.seeds
            if isinstance(seeds, int):
                seeds = [np.random.SeedSequence(0, spawn_key=(i,)) for i in index]
            elif seeds is not None:
                seeds = seeds[here]
            starts = self.x0[here] if len(self.x0) > 1 else np.repeat(self.x0, len(index), axis=0)
            p = np.repeat(self.defaults[None], len(index), axis=0)
            for at, values in self.columns.items():
                p[:, at] = values[here]
            yield Task(index, p, starts, seeds, **{k: v[here] for k, v in places.items()})

    def chunk(self, workers: int) -> int:
        """Members in a task: at least four tasks for each worker, and bounded memory."""
        plan = self.plan
        rows = len(self.states) + (0 if plan.reduce else len(plan.outputs))
        fitting = int(_BLOCK / (8 * len(plan.t) * max(rows, 1)))
        return max(1, min(fitting, _MOST, -(-self.count // (4 * workers))))


def prepare(asked: Asked) -> Prepared:
    """Check the arguments and trace the system. Raises InputError."""
    rtol, reduce, inputs = arguments.settings(asked.rtol, asked.hold), asked.reduce, asked.inputs
    times, columns = arguments.times(asked.t), parameter_columns(asked.params)
    net, _ = net_of(asked.system)
    blocks = [part.block for part in net.parts]
    if reduce is not None and not callable(reduce):
        raise InputError(f"reduce must be a function of t and y, not {shown(reduce)}.")
    if not callable(inputs):
        inputs = arguments.inputs(net.name, net.outside, times, inputs)
    starts, seeds = _starts(net, asked.x0), _seeds(asked.seeds, inputs)
    lengths = dict([("params", len(v)) for v in columns.values() if v.ndim][:1])
    lengths |= {"x0": len(starts)} if len(starts) != 1 else {}
    if seeds is not None:
        lengths["seeds"] = seeds if isinstance(seeds, int) else len(seeds)
    count = next(iter(lengths.values()), 1)
    if len(set(lengths.values())) > 1:
        raise InputError(f"the number of members is not clear: {_listed(lengths)}.")
    if not count:
        raise InputError("the sweep has no members: there is nothing to simulate.")
    outputs, chosen = _chosen(net, "output", asked.outputs), asked.states
    kept = _chosen(net, "state", None if chosen is True else [] if chosen is False else chosen)
    full = {k: np.ascontiguousarray(np.broadcast_to(v, (count,))) for k, v in columns.items()}
    for key, values in full.items():
        numbers = values[~np.isnan(values)]  # a member that is NaN fails alone
        for value in {numbers.min(), numbers.max()} if len(numbers) else ():
            arguments.parameters(blocks, {key: value})
    system = blocks[0] if net.alone else list(asked.system)
    alone = OneByOne(system, tuple(full), outputs, times, asked.hold, rtol)
    solver, names, defaults, places = _solver(net, alone, full)
    keep = tuple(net.states().index(k) for k in kept) if kept else None
    plan = Plan(solver, net.name, net.outside, inputs, keep, reduce, outputs, names, times)
    return Prepared(plan, kept, full, starts, defaults, places, seeds, count)


def parameter_columns(table: Any) -> dict[str, np.ndarray]:
    """The columns of a table of parameters, each (L,), or 0-d for a value that all share."""
    found: dict[str, np.ndarray] = {}
    for name, values in _raw_columns(table).items():
        try:
            numbers = np.asarray(values)
            if numbers.dtype.kind not in "biufO":
                raise TypeError
            found[str(name)] = numbers = numbers.astype(float)
        except (TypeError, ValueError):
            said = f"params: column '{name}' holds a value that is not a number."
            raise InputError(said) from None
        if numbers.ndim > 1:
            raise InputError(
                f"params: column '{name}' has the shape {numbers.shape}; give one value "
                "for each member."
            )
    lengths = {name: len(values) for name, values in found.items() if values.ndim}
    if len(set(lengths.values())) > 1:
        raise InputError(f"the columns of params differ in length: {_listed(lengths)}.")
    return found


def _raw_columns(table: Any) -> Mapping[Any, Any]:
    if table is None:
        return {}
    if isinstance(table, Mapping):
        return table
    if isinstance(table, np.ndarray):
        if table.dtype.names is None:
            raise InputError(f"params is an array without names; give {_FORMS}.")
        return {name: table[name] for name in table.dtype.names}
    if hasattr(table, "columns_of"):  # the members of a result
        return table.columns_of("plant")
    if hasattr(table, "columns") and hasattr(table, "to_numpy"):
        return {name: table[name].to_numpy() for name in table.columns}
    if not isinstance(table, Sequence) or not all(isinstance(row, Mapping) for row in table):
        raise InputError(f"params is a {type(table).__name__}; give {_FORMS}.")
    if not table:
        raise InputError("params is an empty list: there is nothing to simulate.")
    for i, row in enumerate(table):
        odd = set(row) ^ set(table[0])
        if odd:
            raise InputError(
                f"params: members 0 and {i} do not have the same parameters; "
                f"one does not have '{sorted(map(str, odd))[0]}'."
            )
    return {name: [row[name] for row in table] for name in table[0]}


def _listed(lengths: Mapping[str, int]) -> str:
    return ", ".join(f"{what} {length}" for what, length in lengths.items())


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


def _starts(net: Net, x0: Any) -> np.ndarray:
    try:
        rows: Any = array(0.0 if x0 is None else x0, "x0")
    except InputError:  # parts, as python-control takes them
        rows = np.zeros(1)
    count = len(net.states())
    if rows.ndim != 2:
        return arguments.start(net.name, count, x0)[None]
    if rows.shape[1] != count:
        raise InputError(f"x0 has the shape {rows.shape}; {net.name} needs (members, {count}).")
    return np.array(rows)


def _seeds(seeds: Any, inputs: Any) -> int | Sequence[Any] | None:
    if seeds is None:
        return None
    if not callable(inputs):
        raise InputError("seeds are for random inputs: give inputs as a function of a Generator.")
    if np.ndim(seeds) == 0 and np.issubdtype(np.asarray(seeds).dtype, np.integer):
        return max(int(seeds), 0)
    try:
        return [s if isinstance(s, np.random.SeedSequence) else int(s) for s in seeds]
    except (TypeError, ValueError):
        raise InputError("seeds must be a number of members or a list of whole numbers.") from None


Solver = tuple[Traced | OneByOne, tuple[str, ...], np.ndarray, Mapping[int, np.ndarray]]


def _solver(net: Net, alone: OneByOne, columns: Mapping[str, np.ndarray]) -> Solver:
    """Generated code, or ``alone``, with names, defaults and columns of its parameters."""
    if not net.groups:
        try:
            engine, given = _engine(net, columns)
            keys, defaults = engine.program.keys, engine.program.arguments(given)
            places = {i: columns[k] for i, k in enumerate(keys) if k in columns}
            p = defaults.copy()
            for at, values in places.items():
                p[at] = np.nanmax(values, initial=-np.inf)
            # generated code alone cannot keep the past of a dead time
            if not any(delay > 0.0 for delay in lates(engine.program, p).values()):
                rows = tuple(map(net.signals.index, alone.outputs))
                traced = Traced(engine.portable(), rows, alone.t, alone.hold, alone.rtol)
                return traced, tuple(keys), defaults, places
        except TraceError as error:
            warnings.warn(
                f"{error}; the members are simulated one by one in this process, traced "
                "separately if possible, else by LSODA.",
                RuntimeWarning,
                stacklevel=4,
            )
    return alone, alone.names, np.zeros(len(columns)), dict(enumerate(columns.values()))


def _engine(net: Net, columns: Mapping[str, np.ndarray]) -> tuple[Engine, dict[str, float]]:
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
