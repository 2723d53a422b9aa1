"""Sweeps: many runs of one system, checked once, shared out among workers, and their result."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.display import Row
from ..core.errors import Diverged, InputError
from ..core.jobs import JobError, run_jobs
from ..core.progress import Wanted, bar_for, reporter, shows_progress
from ..core.result import Result, library, plain
from ..core.validation import array, shown, whole
from ..core.views import view
from ..engine.adaptive_run import Accuracy, Course, Engine, bounded, first_bad
from ..engine.backend import threads
from ..engine.delays import lates
from ..engine.graph import TraceError
from ..engine.memo import compiled
from ..engine.tracer import Net
from . import arguments
from .response import net_of, simulate

_FORMS = "a dict of columns, a list of dicts, a structured array or a DataFrame"
_BLOCK = 32e6  # bytes of results in one task, about
_MOST = 256  # members in one task
_ASKED_AHEAD = 16  # number of workers assumed for an executor that does not give it


@dataclass(frozen=True, repr=False, eq=False)
class Sweep(Result):
    """Many runs of one system. ``sweep["w"]`` is one signal of all members, (L, N).

    Attributes
    ----------
    name : str
        Name of the system.
    t : (N,) ndarray
        Times in s.
    outputs, states : tuple of str
        Labels of the rows of ``y`` and ``x``.
    y : (L, ny, N) ndarray or None
        Outputs; nan for members that failed or were not run; None with ``reduce``.
    x : (L, nx, N) ndarray or None
        The requested states.
    reduced : (L, ...) ndarray or None
        The result of ``reduce`` for each member.
    params : dict of (L,) ndarray
        The table of parameters.
    members : (L,) ndarray
        Numbers of the members (for a chunk: within the whole sweep).
    done : (L,) ndarray of bool
        Members that were run, with or without success.
    failed : dict
        Number of a failed member -> a sentence on what happened.
    coarse : dict
        Number of a member whose sign or comparison switched without end -> the time in s.
    message : str or None
        A note on the sweep as a whole.

    Examples
    --------
    What became of three values of Coulomb friction:

    >>> table = {"plant.Fc": [0.25, 0.285, 0.32]}
    >>> t = np.linspace(0.0, 1.0, 501)
    >>> s = lg.sweep(lg.velocity_loop(lg.table1(), "proposed"), t, 0.1 * np.sin(6.28 * t), table)
    >>> s["w"].shape, bool(s.done.all()), s.failed
    ((3, 501), True, {})
    """

    name: str
    t: np.ndarray
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    y: np.ndarray | None
    x: np.ndarray | None
    reduced: np.ndarray | None
    params: Mapping[str, np.ndarray]
    members: np.ndarray
    done: np.ndarray
    failed: Mapping[int, str] = field(default_factory=dict)
    coarse: Mapping[int, float] = field(default_factory=dict)
    message: str | None = None

    def __len__(self) -> int:
        return len(self.members)

    def __getitem__(self, signal: str) -> np.ndarray:
        for labels, values in ((self.outputs, self.y), (self.states, self.x)):
            if signal in labels and values is not None:
                return values[:, labels.index(signal)]
        there = ", ".join([*(self.outputs if self.y is not None else ()), *self.states])
        raise InputError(f"this sweep holds no signal '{signal}'; it holds {there or 'none'}.")

    @property
    def ok(self) -> np.ndarray:
        """(L,) bool: the members that succeeded."""
        return self.done & ~np.isin(self.members, list(self.failed))

    def summary(self) -> dict[str, Any]:
        """Plain Python: sizes, ranges of parameters, what failed (the first ten)."""
        return plain(
            {
                "system": self.name,
                "members": len(self),
                "done": int(self.done.sum()),
                "succeeded": int(self.ok.sum()),
                "failed": len(self.failed),
                "failures": dict(sorted(self.failed.items())[:10]),
                "coarse": len(self.coarse),
                "samples": len(self.t),
                "duration": float(self.t[-1] - self.t[0]),
                "outputs": self.outputs,
                "states": self.states,
                "parameters": self._ranges(),
                "message": self.message,
            }
        )

    def to_pandas(self) -> Any:
        """A DataFrame: a row for each member and time, a column for each signal.

        With ``reduce``: a row for each member, with its parameters. Raises InputError if pandas
        is not installed.
        """
        pandas = library("pandas")
        index = pandas.Index(self.members, name="member")
        if self.reduced is not None:
            flat = self.reduced.reshape(len(self), -1)
            names = [f"reduced{i}" for i in range(flat.shape[1])]
            names = ["reduced"] if self.reduced.ndim == 1 else names
            columns = {k: flat[:, i] for i, k in enumerate(names)}
            return pandas.DataFrame({**self.params, **columns}, index=index)
        both = pandas.MultiIndex.from_product([self.members, self.t], names=["member", "t"])
        return pandas.DataFrame({k: self[k].ravel() for k in self._signals()}, index=both)

    def to_frame(self) -> Any:
        """The same as :meth:`to_pandas`."""
        return self.to_pandas()

    def to_xarray(self) -> Any:
        """A Dataset over member and t (and those of ``reduced``), parameters as coordinates.

        Raises InputError if xarray is not installed.
        """
        xarray = library("xarray")
        data: dict[str, Any] = {k: (("member", "t"), self[k]) for k in self._signals()}
        coords = {"member": self.members, "t": self.t}
        if self.reduced is not None:
            extra = [f"reduced_{i}" for i in range(self.reduced.ndim - 1)]
            data["reduced"] = (("member", *extra), self.reduced)
        beside = {k: ("member", v) for k, v in self.params.items()} | {
            "done": ("member", self.done)
        }
        taken = {*data, *coords}
        renamed = {f"parameter {k}" if k in taken else k: v for k, v in beside.items()}
        return xarray.Dataset(data, {**coords, **renamed}, {"system": self.name})

    def plot(self, ax: Any = None, output: str | None = None) -> Any:
        """Median and the band from 5 to 95 % of one output (the first); returns the Axes.

        Draws into ``ax``, or into a new figure that shows itself.
        """
        return view("loop_plots.sweep")(self, ax, output)

    def _signals(self) -> list[str]:
        outputs = self.outputs if self.y is not None else ()
        return list(dict.fromkeys([*outputs, *self.states]))

    def _ranges(self) -> dict[str, list[Any]]:
        known = {k: v for k, v in self.params.items() if not np.all(np.isnan(v))}
        return {k: [np.nanmin(v), np.nanmax(v)] for k, v in known.items()}

    def __str__(self) -> str:
        said = f"{self.name}: {int(self.ok.sum())} of {len(self)} members simulated"
        said += f", {len(self.failed)} failed" if self.failed else ""
        return said + f", {len(self.t)} samples to {self.t[-1]:g} s."

    def _title(self) -> str:
        return f"Sweep {self}"

    def _rows(self) -> Iterable[Row]:
        ranges = [*self._ranges().items()][:6]
        return [
            Row("signals", ", ".join(self._signals()) or "none"),
            *(Row(k, f"{low:.6g} to {high:.6g}") for k, (low, high) in ranges),
            *(Row(f"member {i}", said) for i, said in sorted(self.failed.items())[:3]),
        ]


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
        not be picklable; functions ``inputs`` and ``reduce`` are sent too, and must be for
        processes. Workers need lugrectl, and a C compiler or numba if this process has one.
    jobs : int
        Without ``executor``: with a C compiler or numba, the number of threads (default: all
        cores). Without them members run one after the other, because Python threads would not run
        in parallel. With ``executor``: its number of workers, if it does not give it itself.
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
        For a table of unknown form, numbers of members that differ, unknown names, and shapes
        that do not fit.

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
    made = _prepared(system, t, inputs, params, (x0, seeds, outputs, states), how)
    bar = bar_for(progress)

    def parts() -> Iterator[Sweep]:
        with bar as report, contextlib.closing(made.answers(report)) as answers:
            for index, found in answers:
                part = _Gathered(made, index)
                part.take(index, found)
                yield replace(part.result(), message=None)

    return parts()


@dataclass(frozen=True)
class _Plan:
    """What a worker needs. ``engine`` is code, which can be sent to other processes; None: the
    ``system`` is simulated member by member in this one."""

    engine: Engine | None
    system: Any
    net: str
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

    @property
    def is_free(self) -> bool:
        """Whether other threads run beside a member: compiled code lets them."""
        return self.engine is not None and self.engine.backend != "python"

    def work(self, task: Task) -> list[Answer]:
        """Simulate all members of a task."""
        engine = self.engine and self.engine.loaded()
        index, p, x0, seeds = task
        found: list[Answer] = []
        for row, member in enumerate(index):
            try:
                seed = member if seeds is None else np.random.default_rng(seeds[row])
                found.append(self._answer(engine, p[row], x0[row], seed))
            except Exception as error:  # of the member or of a user's function: stored, not raised
                found.append(JobError.of(member, error).sentence)
        return found

    def _answer(self, engine: Engine | None, p: np.ndarray, x0: np.ndarray, seed: Any) -> Answer:
        u = self.inputs
        if np.isnan(p).any():
            raise InputError(f"parameter {self.parameters[int(np.argmax(np.isnan(p)))]} is nan.")
        if not np.all(np.isfinite(x0)):
            raise InputError("x0 is not finite.")
        if callable(u):
            with _named("inputs"):  # with seeds random numbers depend on the member's seed only
                u = arguments.inputs(self.net, self.labels, self.t, u(seed))
        x, y, unsettled = (
            self._one_by_one(u, x0, p) if engine is None else self._traced(engine, u, x0, p)
        )
        kept = x[self.keep] if self.keep else None
        if self.reduce is None:
            return y, kept, None, unsettled
        with _named("reduce"):
            return None, kept, np.asarray(self.reduce(self.t, y), dtype=float), unsettled

    def _traced(self, engine: Engine, u: np.ndarray, x0: np.ndarray, p: np.ndarray) -> Any:
        course = Course.along(self.t, u, 0, self.hold)
        track = engine.follow(course, x0, np.zeros(0), p, Accuracy(self.rtol))
        labels, y = [f"output {k}" for k in self.outputs], track.y[self.rows]
        bad = first_bad(self.t, y)
        if bad is not None:
            raise Diverged(f"{self.net}: {labels[bad[0]]} is {bad[2]}")
        bounded(self.net, self.t, [y], lambda: [labels], [u, x0], looped=False)
        return track.x, y, track.unsettled

    def _one_by_one(self, u: np.ndarray, x0: np.ndarray, p: np.ndarray) -> Any:
        params = dict(zip(self.parameters, p.tolist(), strict=True)) or None
        options: dict[str, Any] = {"hold": self.hold, "rtol": self.rtol, "squeeze": False}
        with warnings.catch_warnings():  # the warning was given once for all members
            warnings.simplefilter("ignore", RuntimeWarning)
            response = simulate(self.system, self.t, u, x0, params=params, **options)
        x = np.empty((0, len(self.t))) if response.states is None else response.states
        return np.atleast_2d(x), np.asarray(response.outputs)[self.rows], np.nan


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
            for at, key in enumerate(self.plan.parameters):
                p[:, at] = self.params[key][here] if key in self.params else p[:, at]
            yield index, p, starts, seeds

    def answers(self, progress: Callable[[float, str], Any]) -> Answers:
        """The members of each task with their answers, as they are done."""
        executor, pool, done = self.executor, None, 0
        if executor is None and self.workers > 1 and self.plan.is_free:
            pool = executor = ThreadPoolExecutor(self.workers)
        found = run_jobs(self.plan.work, self.tasks(), executor=executor, jobs=self.workers)
        try:
            for number, answers in found:
                index = range(number * self.size, min((number + 1) * self.size, self.count))
                yield index, answers
                done += len(index)
                progress(done / self.count, f"{done} of {self.count} members")
        finally:
            found.close()
            if pool is not None:
                pool.shutdown(cancel_futures=True)


class _Gathered:
    """The answers of the members of a range."""

    def __init__(self, made: _Prepared, index: range) -> None:
        self.made, self.index, plan = made, index, made.plan
        shapes = {"y": len(plan.rows)} if plan.reduce is None else {}
        shapes |= {"x": len(plan.keep)} if plan.keep else {}
        size = len(index), len(plan.t)
        self.arrays: dict[str, Any] = {
            k: np.full((size[0], rows, size[1]), np.nan) for k, rows in shapes.items()
        }
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
            named: Any = zip(("y", "x", "reduced"), answer, strict=False)
            for name, values in ((k, v) for k, v in named if v is not None):
                if name not in self.arrays:
                    self.arrays[name] = np.full((len(self.done), *values.shape), np.nan)
                rows = self.arrays[name]
                if values.shape == rows.shape[1:]:
                    rows[member - self.index.start] = values
                else:
                    said = f"gave the shape {values.shape}, for another member {rows.shape[1:]}."
                    self.failed[member] = f"reduce: {said}"
            if np.isfinite(answer[3]):
                self.coarse[member] = float(answer[3])

    def result(self) -> Sweep:
        plan, first, last = self.made.plan, self.index.start, self.index.stop
        none = None if plan.reduce is None else np.full(len(self.index), np.nan)
        return Sweep(
            plan.net,
            plan.t,
            plan.outputs,
            self.made.states,
            self.arrays.get("y"),
            self.arrays.get("x"),
            self.arrays.get("reduced", none),
            {k: v[first:last] for k, v in self.made.params.items()},
            np.arange(first, last),
            self.done,
            dict(sorted(self.failed.items())),
            dict(sorted(self.coarse.items())),
            self._message(),
        )

    def _message(self) -> str | None:
        name, count, said = self.made.plan.net, len(self.index), []
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
    engine, defaults = _engine(net, full)
    system = None if engine else net.parts[0].block if net.alone else list(given)
    rows, keep = [*map(net.signals.index, outputs)], [*map(net.states().index, kept)]
    labels = net.name, net.outside, inputs, outputs, rows, keep, tuple(defaults)
    plan = _Plan(engine, system, *labels, times, hold, rtol, reduce)
    values = np.array([*defaults.values()])
    return _Prepared(
        plan, kept, full, starts, values, seeds, count, *_shares(plan, count, executor, jobs, chunk)
    )


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


def _shares(
    plan: _Plan, count: int, executor: Any, jobs: int | None, chunk: int | None
) -> tuple[Executor | None, int, int]:
    """The executor, its workers, and the members in a task: so many that there are at least four
    tasks for each worker, and memory is bounded."""
    for name, number in (("jobs", jobs), ("chunk", chunk)):
        if number is not None:
            whole(number, name, 1)
    if executor is not None and not hasattr(executor, "submit"):
        raise InputError(f"executor must be a concurrent.futures.Executor, not {shown(executor)}.")
    if plan.engine is None:
        executor, jobs = None, 1
    elif executor is None:
        jobs = (jobs or min(threads(), os.cpu_count() or 1)) if plan.is_free else 1
    workers = jobs or getattr(executor, "_max_workers", None) or _ASKED_AHEAD
    rows = len(plan.keep) + (0 if plan.reduce else len(plan.rows))
    fitting = int(_BLOCK / (8 * len(plan.t) * max(rows, 1)))
    size = max(1, min(fitting, _MOST, -(-count // (4 * workers))))
    slow = executor is None and not plan.is_free  # then each member is told
    return executor, workers, chunk or (1 if slow else size)


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
    table = {} if table is None else table
    if isinstance(table, Mapping):
        return table
    if hasattr(table, "columns_of"):  # the members of a result
        return table.columns_of("plant")
    names = getattr(getattr(table, "dtype", None), "names", None) or getattr(table, "columns", None)
    if names is not None:
        return {name: np.asarray(table[name]) for name in names}
    if not isinstance(table, Sequence) or not all(isinstance(row, Mapping) for row in table):
        raise InputError(f"params is a {type(table).__name__} without names; give {_FORMS}.")
    if not table:
        raise InputError("params is an empty list: there is nothing to simulate.")
    for i, row in enumerate(table):
        if odd := set(row) ^ set(table[0]):
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
        rows = array(0.0 if x0 is None else x0, "x0")
    except InputError:  # parts, as python-control takes them
        rows = array(0.0, "x0")
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


def _engine(
    net: Net, columns: Mapping[str, np.ndarray]
) -> tuple[Engine | None, Mapping[str, float]]:
    """Generated code, or None, with the defaults of the parameters.

    It is traced with the largest value of each column: of the width of a sign that decides whether
    the sign is smooth, and a parameter that is needed as a number must have it in all members.
    """
    most = {k: float(np.nanmax(v, initial=-np.inf)) for k, v in columns.items()}
    try:
        engine = None if net.groups else compiled(net, most)
        if engine is not None:
            program = engine.program
            fixed = [k for k in program.fixed if k in columns]
            changing = [k for k in fixed if np.any(columns[k] != program.fixed[k])]
            if changing:
                raise TraceError(
                    f"{net.name}: parameter {changing[0]} changes the equations themselves"
                )
            p = program.arguments(most)
            # generated code alone cannot keep the past of a dead time
            if not any(delay > 0.0 for delay in lates(program, p).values()):
                return engine.portable(), dict(zip(program.keys, p, strict=True))
    except TraceError as error:
        warnings.warn(
            f"{error}; the members are simulated one by one in this process, traced "
            "separately if possible, else by LSODA.",
            RuntimeWarning,
            stacklevel=4,
        )
    return None, dict.fromkeys(columns, 0.0)
