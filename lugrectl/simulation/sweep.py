"""Sweeps: collect all results, or yield them chunk by chunk."""

from __future__ import annotations

import os
import pickle
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import validation
from ..core.errors import InputError
from ..core.jobs import JobError, run_jobs
from ..core.progress import Progress, Wanted, bar_for, reporter, shows_progress
from ..engine.runtime.backend import threads
from .sweep_members import Asked, Block, Prepared, prepare, work
from .sweep_result import Sweep

_ASKED_AHEAD = 16  # number of workers assumed for an executor that does not give it
_SENT = ("inputs", "reduce")  # functions of the user, which other processes may need

Blocks = Generator[tuple[range, Block | JobError]]  # the members of each task with their answers


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
    asked = Asked(system, t, inputs, params, x0, seeds, outputs, states, hold, rtol, reduce)
    made = prepare(asked)
    gathered = _Gathered(made, range(made.count))
    blocks = _blocks(made, _How(executor, jobs, chunk, reporter(progress)), gathered)
    try:
        for index, block in blocks:
            gathered.take(index, block)
    except KeyboardInterrupt:
        gathered.interrupted = True
    finally:
        blocks.close()
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
    asked = Asked(system, t, inputs, params, x0, seeds, outputs, states, hold, rtol, reduce)
    made, bar = prepare(asked), bar_for(progress)
    blocks = _blocks(made, _How(executor, jobs, chunk, bar))

    def parts() -> Iterator[Sweep]:
        try:
            for index, block in blocks:
                part = _Gathered(made, index)
                part.take(index, block)
                yield replace(part.result(), message=None)
        finally:
            blocks.close()
            bar.close()

    return parts()


@dataclass(frozen=True)
class _How:
    """How the work is shared out."""

    executor: Executor | None
    jobs: int | None
    chunk: int | None
    progress: Progress | None


def _blocks(made: Prepared, how: _How, whole: _Gathered | None = None) -> Blocks:
    """Check at once how the work is to be shared out; then yield each task's answers."""
    executor, jobs = how.executor, how.jobs
    for name, number in (("jobs", jobs), ("chunk", how.chunk)):
        if number is not None:
            validation.whole(number, name, 1)
    if executor is not None and not hasattr(executor, "submit"):
        raise InputError(
            f"executor must be a concurrent.futures.Executor, not {validation.shown(executor)}."
        )
    if not made.plan.carried:
        executor, jobs = None, 1
    elif executor is None:
        jobs = jobs or (min(threads(), os.cpu_count() or 1) if made.compiled else 1)
    alone = executor is None and (made.compiled or jobs == 1)  # in this process
    for what in () if alone or not isinstance(executor, ProcessPoolExecutor | None) else _SENT:
        try:
            pickle.dumps(getattr(made.plan, what))
        except Exception as error:
            raise InputError(
                f"{what} cannot be sent to another process ({error}); "
                "define the function at the top of a module."
            ) from None
    places = whole.arrays if whole is not None and alone else {}
    return _run(made, replace(how, executor=executor, jobs=jobs), places)


def _run(made: Prepared, how: _How, places: dict[str, np.ndarray]) -> Blocks:
    executor, pool = how.executor, None
    workers = how.jobs or getattr(executor, "_max_workers", None) or _ASKED_AHEAD
    one_by_one = executor is None and workers == 1 and not made.compiled
    size = how.chunk or (1 if one_by_one else made.chunk(workers))
    if made.compiled and executor is None and workers > 1:
        pool = executor = ThreadPoolExecutor(workers)
    done, tasks = 0, made.tasks(size, places)
    answers = run_jobs(partial(work, made.plan), tasks, executor=executor, jobs=workers)
    try:
        for number, block in answers:
            index = range(number * size, min((number + 1) * size, made.count))
            yield index, block
            done += len(index)
            if how.progress is not None:
                how.progress(done / made.count, f"{done} of {made.count} members")
    finally:
        getattr(answers, "close", lambda: None)()
        if pool is not None:
            pool.shutdown(cancel_futures=True)


class _Gathered:
    """Arrays for the members of a range, filled as answers arrive, or by workers themselves."""

    def __init__(self, made: Prepared, index: range) -> None:
        self.made, self.index, plan = made, index, made.plan
        shapes = {} if plan.reduce is not None else {"y": plan.shape}
        shapes |= {} if plan.keep is None else {"x": (len(plan.keep), len(plan.t))}
        self.arrays = {name: np.empty((len(index), *shape)) for name, shape in shapes.items()}
        self.reduced: np.ndarray | None = None
        self.done = np.zeros(len(index), dtype=bool)
        self.failed, self.coarse = dict[int, str](), dict[int, float]()
        self.interrupted = False

    def take(self, index: range, block: Block | JobError) -> None:
        here = slice(index.start - self.index.start, index.stop - self.index.start)
        self.done[here] = True
        if isinstance(block, JobError):
            self.failed |= dict.fromkeys(index, block.sentence)
            return
        self.failed |= block.failed
        self.coarse |= block.coarse
        for name, whole in self.arrays.items():
            if not np.may_share_memory(whole, part := getattr(block, name)):
                whole[here] = part
        for member, value in zip(index, block.reduced or (), strict=False):
            if value is None:
                continue
            if self.reduced is None:
                self.reduced = np.full((len(self.index), *value.shape), np.nan)
            shape = self.reduced.shape[1:]
            if value.shape == shape:
                self.reduced[member - self.index.start] = value
            else:
                self.failed[member] = (
                    f"reduce: gave the shape {value.shape}, for another member {shape}."
                )

    def result(self) -> Sweep:
        made, first, last = self.made, self.index.start, self.index.stop
        lost = ~self.done  # members not run, tasks that failed entirely
        lost[[member - first for member in self.failed]] = True
        for values in self.arrays.values():
            values[lost] = np.nan
        if made.plan.reduce is not None and self.reduced is None:
            self.reduced = np.full(len(self.index), np.nan)
        return Sweep(
            made.plan.name,
            made.plan.t,
            made.plan.outputs,
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
