"""Sweeps: many runs of one system, checked once, and shared out among workers."""

from __future__ import annotations

import contextlib
import os
import pickle
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import Diverged, InputError
from ..core.jobs import JobError, run_jobs
from ..core.progress import Wanted, bar_for, reporter, shows_progress
from ..core.validation import array, shown, whole
from ..engine.adaptive_run import Accuracy, Course, Engine, bounded, first_bad
from ..engine.backend import threads
from ..engine.delays import lates
from ..engine.graph import TraceError
from ..engine.memo import compiled
from ..engine.tracer import Net, widths
from . import arguments
from .response import net_of, simulate
from .sweep_result import Sweep

_FORMS = "a dict of columns, a list of dicts, a structured array or a DataFrame"
_BLOCK = 32e6  # bytes of results in one task, about
_MOST = 256  # members in one task
_ASKED_AHEAD = 16  # number of workers assumed for an executor that does not give it
_SENT = ("inputs", "reduce")  # functions of the user, which other processes may need

Task = tuple[range, np.ndarray, np.ndarray, Sequence[Any] | None]  # members, p, x0, seeds
# of a member: y, the requested states, what ``reduce`` made of y, unsettled time; or what failed
Answer = tuple[Any, Any, Any, float] | str
Answers = Generator[tuple[range, list[Answer] | JobError]]


@shows_progress
def sweep(
    system: Any,
    t: ArrayLike,
    inputs: Any = None,
    params: Any = None,
    *,
    x0: ArrayLike | Sequence[Any] | None = None,
    seeds: int | Sequence[int] | None = None,
    outputs: Sequence[str] | None = None,
    states: bool | Sequence[str] = False,
    hold: bool = False,
    rtol: float = 1e-6,
    executor: Executor | None = None,
    jobs: int | None = None,
    chunk: int | None = None,
    progress: Wanted = None,
    reduce: Callable[[np.ndarray, np.ndarray], Any] | None = None,
) -> Sweep:
    """Run a system for many parameter sets, initial states or random inputs.

    Each member is the result of
    ``simulate(system, t, inputs, x0, params=row, hold=hold, rtol=rtol)`` for its row of the table.

    Parameters
    ----------
    system : control.NonlinearIOSystem or list of them
        As for ``simulate``; traced and compiled once for all members.
    t : (N,) array_like
        Increasing times in s.
    inputs : array_like, list or callable
        As for ``simulate``, for all members; or a function that returns a member's inputs. Its
        argument is the member's number, or with ``seeds`` its ``numpy.random.Generator``.
    params : dict of columns, list of dicts, structured array or DataFrame
        The table: a row for each member; a number in a dict is used for all members.
    x0 : array_like
        (L, n): a row for each member; else as for ``simulate``, for all members.
    seeds : int or list of int or SeedSequence
        The number of members, whose generators are spawned from one ``SeedSequence(0)``; or a
        seed for each. A member's random numbers do not depend on chunks, jobs or the executor.
    outputs : list of str
        Outputs to return; default all.
    states : bool or list of str
        States to return in ``.x``; default none.
    hold, rtol
        As for ``simulate``.
    executor : concurrent.futures.Executor
        Runs the chunks: threads, processes, ``dask.distributed.Client.get_executor()``, mpi4py,
        Ray. Only generated source text and numbers are sent, never the system, so blocks need
        not be picklable. Workers need lugrectl, and a C compiler or numba if this process has one.
    jobs : int
        Without ``executor``: with a C compiler or numba, the number of threads (default: all
        cores). Without them members run one after the other by default, because Python threads
        would not run in parallel and new processes would re-run a script without
        ``if __name__ == "__main__":``; ``jobs`` above 1 starts that many processes. With
        ``executor``: its number of workers, if it does not give it itself.
    chunk : int
        Members in a task; default by the number of workers and the size of the results.
    progress : callable, True, False or None
        ``progress(fraction, what)`` after each chunk, or whether to show a bar. None: in
        Jupyter only.
    reduce : callable
        ``reduce(t, y)`` with y (ny, N) returns a number or an array, of the same shape for all
        members. It is called in the process that simulated the member; ``.reduced`` holds the
        results and ``.y`` is None.

    Returns
    -------
    Sweep
        ``.y`` (L, ny, N), ``.x``, ``.params``, ``.done``, ``.failed``. A member that fails (it
        diverges, or ``inputs`` raises for it) has nan rows and a sentence in ``.failed``, and
        one warning counts them. On Ctrl-C the finished members are returned, with a warning.

    Raises
    ------
    InputError
        For a table of unknown form, numbers of members that differ, unknown names, shapes that
        do not fit, and a function that cannot be sent to a process.

    Notes
    -----
    A system that cannot be traced, or whose equations change with a swept parameter, is simulated
    member by member in this process, with one warning. The same holds for sampled blocks, without
    a warning.

    Examples
    --------
    The speed error of 50 drives that differ in friction:

    >>> loop = lg.velocity_loop(lg.table1(), "proposed")
    >>> t = np.linspace(0.0, 1.0, 501)
    >>> r = 0.1 * np.sin(2 * np.pi * t)
    >>> table = {"plant.Fc": np.linspace(0.2, 0.4, 50), "pi.kp": 1.6}
    >>> s = lg.sweep(loop, t, r, table, outputs=["e"])
    >>> s["e"].shape
    (50, 501)

    On a cluster (extra ``cluster``), where ``client`` is
    ``dask.distributed.Client("tcp://scheduler:8786")``:

    >>> s = lg.sweep(loop, t, r, table, executor=client.get_executor())  # doctest: +SKIP
    """
    how = hold, rtol, executor, jobs, chunk, reduce
    made = _prepared(system, t, inputs, params, (x0, seeds, outputs, states), how)
    gathered = _Gathered(made, range(made.count))
    answers = made.answers(reporter(progress))
    try:
        for index, found in answers:
            gathered.take(index, found)
    except KeyboardInterrupt:
        gathered.interrupted = True
    finally:
        answers.close()
    result = gathered.result()
    if result.message:
        warnings.warn(result.message, RuntimeWarning, stacklevel=2)
    return result


def sweep_chunks(
    system: Any,
    t: ArrayLike,
    inputs: Any = None,
    params: Any = None,
    *,
    x0: ArrayLike | Sequence[Any] | None = None,
    seeds: int | Sequence[int] | None = None,
    outputs: Sequence[str] | None = None,
    states: bool | Sequence[str] = False,
    hold: bool = False,
    rtol: float = 1e-6,
    executor: Executor | None = None,
    jobs: int | None = None,
    chunk: int | None = None,
    progress: Wanted = None,
    reduce: Callable[[np.ndarray, np.ndarray], Any] | None = None,
) -> Iterator[Sweep]:
    """The same as :func:`sweep`, as an iterator of parts in the order in which they finish.

    Memory grows with the chunks in progress (two for each worker), not with the number of
    members. Ctrl-C is raised after the finished parts.

    Parameters
    ----------
    system, t, inputs, params, x0, seeds, outputs, states, hold, rtol
        As for :func:`sweep`: what is simulated.
    executor, jobs, chunk, progress, reduce
        As for :func:`sweep`: how the work is shared and what is kept of it.

    Yields
    ------
    Sweep
        Each part; ``.members`` gives the members in it. Failures are in its ``.failed``, without a
        warning.

    Raises
    ------
    InputError
        As :func:`sweep`.

    Examples
    --------
    The peak speed of each member, without holding all signals at once. It falls with the friction
    that the observer does not know of:

    >>> loop = lg.velocity_loop(lg.table1(), "proposed")
    >>> t = np.linspace(0.0, 1.0, 501)
    >>> table = {"plant.Fc": np.linspace(0.2, 0.4, 50)}
    >>> peak = np.full(50, np.nan)
    >>> for part in lg.sweep_chunks(loop, t, 0.1 * np.sin(2 * np.pi * t), table, chunk=10):
    ...     peak[part.members] = part["w"].max(axis=1)
    >>> bool(peak[0] > peak[-1])
    True
    """
    how = hold, rtol, executor, jobs, chunk, reduce
    made, bar = (
        _prepared(system, t, inputs, params, (x0, seeds, outputs, states), how),
        bar_for(progress),
    )
    answers = made.answers(bar)

    def parts() -> Iterator[Sweep]:
        try:
            for index, found in answers:
                part = _Gathered(made, index)
                part.take(index, found)
                yield replace(part.result(), message=None)
        finally:
            answers.close()
            bar.close()

    return parts()


@dataclass(frozen=True)
class _Plan:
    """The data common to all members: all that a worker needs.

    ``engine`` is generated code, which can be sent to other processes; None: the ``system`` is
    simulated member by member in this one.
    """

    engine: Engine | None
    system: Any
    name: str
    labels: tuple[str, ...]  # of the inputs
    inputs: Any  # (m, N), or a function
    outputs: tuple[str, ...]
    rows: list[int]  # of the outputs among all signals
    keep: list[int]  # of the requested states among all
    parameters: tuple[str, ...]
    t: np.ndarray
    hold: bool
    rtol: float
    reduce: Callable[[np.ndarray, np.ndarray], Any] | None


def _work(plan: _Plan, task: Task) -> list[Answer]:
    """Simulate all members of a task."""
    engine = plan.engine and plan.engine.loaded()
    index, p, x0, seeds = task
    found: list[Answer] = []
    for row, member in enumerate(index):
        try:
            seed = member if seeds is None else np.random.default_rng(seeds[row])
            found.append(_simulated(plan, engine, p[row], x0[row], seed))
        except Exception as error:  # of the member or of a user's function: stored, not raised
            found.append(JobError.of(member, error).sentence)
    return found


def _simulated(
    plan: _Plan, engine: Engine | None, p: np.ndarray, x0: np.ndarray, seed: Any
) -> Answer:
    u = plan.inputs
    if np.isnan(p).any():
        raise InputError(f"parameter {plan.parameters[int(np.argmax(np.isnan(p)))]} is nan.")
    if not np.all(np.isfinite(x0)):
        raise InputError("x0 is not finite.")
    if callable(u):
        with _named("inputs"):  # with seeds random numbers depend on the member's seed only
            u = arguments.inputs(plan.name, plan.labels, plan.t, u(seed))
    solved = _one_by_one(plan, u, x0, p) if engine is None else _traced(plan, engine, u, x0, p)
    states, y, unsettled = solved
    kept = states[plan.keep] if plan.keep else None
    if plan.reduce is None:
        return y, kept, None, unsettled
    with _named("reduce"):
        return None, kept, np.asarray(plan.reduce(plan.t, y), dtype=float), unsettled


def _traced(plan: _Plan, engine: Engine, u: np.ndarray, x0: np.ndarray, p: np.ndarray) -> Any:
    course, none = Course.along(plan.t, u, 0, plan.hold), np.zeros(0)
    track = engine.follow(course, x0, none, p, Accuracy(plan.rtol))
    labels, y = [f"output {k}" for k in plan.outputs], track.y[plan.rows]
    bad = first_bad(plan.t, y)
    if bad is not None:
        raise Diverged(f"{plan.name}: {labels[bad[0]]} is {bad[2]}")
    bounded(plan.name, plan.t, [y], lambda: [labels], [u, x0], looped=False)
    return track.x, y, track.unsettled


def _one_by_one(plan: _Plan, u: np.ndarray, x0: np.ndarray, p: np.ndarray) -> Any:
    params = dict(zip(plan.parameters, p.tolist(), strict=True)) or None
    options: dict[str, Any] = {"hold": plan.hold, "rtol": plan.rtol, "squeeze": False}
    with warnings.catch_warnings():  # the warning was given once for all members
        warnings.simplefilter("ignore", RuntimeWarning)
        response = simulate(plan.system, plan.t, u, x0, params=params, **options)
    states = np.empty((0, len(plan.t))) if response.states is None else response.states
    return np.atleast_2d(states), np.asarray(response.outputs)[plan.rows], np.nan


@contextlib.contextmanager
def _named(what: str) -> Iterator[None]:
    """Name the user's function that failed."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{what}: {JobError.of(0, error).sentence}") from error


@dataclass(frozen=True)
class _Prepared:
    """A sweep that is ready to run."""

    plan: _Plan
    states: tuple[str, ...]
    params: Mapping[str, np.ndarray]  # (L,) each
    x0: np.ndarray  # (L, n), or (1, n) for all
    defaults: np.ndarray  # of the plan's parameters
    columns: Mapping[int, np.ndarray]  # the values in place of them
    seeds: int | Sequence[Any] | None  # a number of generators spawned from one seed, or each seed
    count: int
    executor: Executor | None
    workers: int
    size: int  # members in a task

    def tasks(self) -> Iterator[Task]:
        for first in range(0, self.count, self.size):
            index = range(first, min(first + self.size, self.count))
            here, seeds = slice(index.start, index.stop), self.seeds
            if isinstance(seeds, int):
                seeds = [np.random.SeedSequence(0, spawn_key=(i,)) for i in index]
            elif seeds is not None:
                seeds = seeds[here]
            starts = self.x0[here] if len(self.x0) > 1 else np.repeat(self.x0, len(index), axis=0)
            p = np.repeat(self.defaults[None], len(index), axis=0)
            for at, values in self.columns.items():
                p[:, at] = values[here]
            yield index, p, starts, seeds

    def answers(self, progress: Callable[[float, str], Any] | None) -> Answers:
        """The members of each task with their answers, as they are done."""
        executor, pool, done = self.executor, None, 0
        if executor is None and self.workers > 1 and _beside(self.plan):
            pool = executor = ThreadPoolExecutor(self.workers)
        work = partial(_work, self.plan)
        found = run_jobs(work, self.tasks(), executor=executor, jobs=self.workers)
        try:
            for number, answers in found:
                index = range(number * self.size, min((number + 1) * self.size, self.count))
                yield index, answers
                done += len(index)
                if progress is not None:
                    progress(done / self.count, f"{done} of {self.count} members")
        finally:
            found.close()
            if pool is not None:
                pool.shutdown(cancel_futures=True)


def _beside(plan: _Plan) -> bool:
    """Whether other threads run beside a member: compiled code lets them."""
    return plan.engine is not None and plan.engine.backend != "python"


class _Gathered:
    """The answers of the members of a range."""

    def __init__(self, made: _Prepared, index: range) -> None:
        self.made, self.index, plan = made, index, made.plan
        shapes = {"y": len(plan.rows)} if plan.reduce is None else {}
        shapes |= {"x": len(plan.keep)} if plan.keep else {}
        size = len(index), len(plan.t)
        self.arrays = {k: np.empty((size[0], rows, size[1])) for k, rows in shapes.items()}
        self.reduced: np.ndarray | None = None
        self.done = np.zeros(len(index), dtype=bool)
        self.failed, self.coarse = dict[int, str](), dict[int, float]()
        self.interrupted = False

    def take(self, index: range, found: list[Answer] | JobError) -> None:
        self.done[index.start - self.index.start : index.stop - self.index.start] = True
        answers = [found.sentence] * len(index) if isinstance(found, JobError) else found
        for member, answer in zip(index, answers, strict=True):
            if isinstance(answer, str):
                self.failed[member] = answer
                continue
            row = member - self.index.start
            for name, values in zip("yx", answer, strict=False):
                if values is not None:
                    self.arrays[name][row] = values
            if np.isfinite(answer[3]):
                self.coarse[member] = float(answer[3])
            if answer[2] is not None:
                self._reduced(member, answer[2])

    def _reduced(self, member: int, value: np.ndarray) -> None:
        if self.reduced is None:
            self.reduced = np.full((len(self.index), *value.shape), np.nan)
        shape = self.reduced.shape[1:]
        if value.shape == shape:
            self.reduced[member - self.index.start] = value
        else:
            said = f"reduce: gave the shape {value.shape}, for another member {shape}."
            self.failed[member] = said

    def result(self) -> Sweep:
        made, plan, first, last = self.made, self.made.plan, self.index.start, self.index.stop
        lost = ~self.done  # members not run, tasks that failed entirely
        lost[[member - first for member in self.failed]] = True
        for values in self.arrays.values():
            values[lost] = np.nan
        if plan.reduce is not None and self.reduced is None:
            self.reduced = np.full(len(self.index), np.nan)
        return Sweep(
            plan.name,
            plan.t,
            plan.outputs,
            made.states,
            self.arrays.get("y"),
            self.arrays.get("x"),
            self.reduced,
            {k: v[first:last] for k, v in made.params.items()},
            np.arange(first, last),
            self.done,
            dict(sorted(self.failed.items())),
            dict(sorted(self.coarse.items())),
            self._message(),
        )

    def _message(self) -> str | None:
        name, count, said = self.made.plan.name, len(self.index), []
        if self.interrupted:
            done = int(self.done.sum())
            said.append(f"interrupted: {done} of {count} members are done, the others are nan")
        if self.failed:
            member, sentence = min(self.failed.items())
            said.append(
                f"{len(self.failed)} of {count} members failed; member {member}: {sentence}"
            )
        if self.coarse:
            member, time = min(self.coarse.items())
            said.append(
                f"in {len(self.coarse)} members a sign or comparison switches without end (member "
                f"{member} near t = {time:.6g} s) and the result there is coarse"
            )
        return f"{name}: {'; '.join(said).rstrip('.')}." if said else None


def _prepared(
    given: Any, t: Any, inputs: Any, params: Any, members: tuple[Any, ...], how: tuple[Any, ...]
) -> _Prepared:
    """Check the arguments and trace the system. Raises InputError."""
    (x0, seeds, outputs, states), (hold, rtol, executor, jobs, chunk, reduce) = members, how
    rtol, times = arguments.settings(rtol, hold), arguments.times(t)
    columns = parameter_columns(params)
    net, _ = net_of(given)
    if reduce is not None and not callable(reduce):
        raise InputError(f"reduce must be a function of t and y, not {shown(reduce)}.")
    if not callable(inputs):
        inputs = arguments.inputs(net.name, net.outside, times, inputs)
    starts, seeds = _starts(net, x0), _seeds(seeds, inputs)
    count = _count(columns, starts, seeds)
    full = {k: np.ascontiguousarray(np.broadcast_to(v, (count,))) for k, v in columns.items()}
    for key, values in full.items():
        numbers = values[~np.isnan(values)]  # a member that is NaN fails alone
        for value in {numbers.min(), numbers.max()} if len(numbers) else ():
            arguments.parameters([part.block for part in net.parts], {key: value})
    outputs = _chosen(net, "output", outputs)
    kept = _chosen(net, "state", None if states is True else states or [])
    engine, names, defaults, places = _solver(net, full)
    system = None if engine else net.parts[0].block if net.alone else list(given)
    rows, keep = [*map(net.signals.index, outputs)], [*map(net.states().index, kept)]
    labels = net.name, net.outside, inputs, outputs, rows, keep, names
    plan = _Plan(engine, system, *labels, times, hold, rtol, reduce)
    made = _Prepared(plan, kept, full, starts, defaults, places, seeds, count, None, 1, 1)
    return _shared_out(made, executor, jobs, chunk)


def _count(columns: Mapping[str, np.ndarray], starts: np.ndarray, seeds: Any) -> int:
    """The number of members."""
    lengths = dict([("params", len(v)) for v in columns.values() if v.ndim][:1])
    lengths |= {"x0": len(starts)} if len(starts) != 1 else {}
    if seeds is not None:
        lengths["seeds"] = seeds if isinstance(seeds, int) else len(seeds)
    if len(set(lengths.values())) > 1:
        raise InputError(f"the number of members is not clear: {_listed(lengths)}.")
    count = next(iter(lengths.values()), 1)
    if not count:
        raise InputError("the sweep has no members: there is nothing to simulate.")
    return count


def _shared_out(made: _Prepared, executor: Any, jobs: int | None, chunk: int | None) -> _Prepared:
    """The same with its workers, and with so many members in a task that there are at least four
    tasks for each worker, and memory is bounded."""
    plan, beside = made.plan, _beside(made.plan)
    for name, number in (("jobs", jobs), ("chunk", chunk)):
        if number is not None:
            whole(number, name, 1)
    if executor is not None and not hasattr(executor, "submit"):
        raise InputError(f"executor must be a concurrent.futures.Executor, not {shown(executor)}.")
    if plan.engine is None:
        executor, jobs = None, 1
    elif executor is None:
        jobs = jobs or (min(threads(), os.cpu_count() or 1) if beside else 1)
    alone = executor is None and (beside or jobs == 1)  # in this process
    for what in () if alone or not isinstance(executor, ProcessPoolExecutor | None) else _SENT:
        try:
            pickle.dumps(getattr(plan, what))
        except Exception as error:
            raise InputError(
                f"{what} cannot be sent to another process ({error}); "
                "define the function at the top of a module."
            ) from None
    workers = jobs or getattr(executor, "_max_workers", None) or _ASKED_AHEAD
    rows = len(plan.keep) + (0 if plan.reduce else len(plan.rows))
    fitting = int(_BLOCK / (8 * len(plan.t) * max(rows, 1)))
    size = max(1, min(fitting, _MOST, -(-made.count // (4 * workers))))
    one_by_one = executor is None and workers == 1 and not beside
    return replace(
        made, executor=executor, workers=workers, size=chunk or (1 if one_by_one else size)
    )


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


def _solver(
    net: Net, columns: Mapping[str, np.ndarray]
) -> tuple[Engine | None, tuple[str, ...], np.ndarray, Mapping[int, np.ndarray]]:
    """Generated code, or None, with names, defaults and columns of the parameters."""
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
                return engine.portable(), tuple(keys), defaults, places
        except TraceError as error:
            warnings.warn(
                f"{error}; the members are simulated one by one in this process, traced "
                "separately if possible, else by LSODA.",
                RuntimeWarning,
                stacklevel=4,
            )
    return None, tuple(columns), np.zeros(len(columns)), dict(enumerate(columns.values()))


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
