"""Independent jobs in this process, on processes of this machine, or on any executor.

A bounded number of them is in progress, so that neither items nor results accumulate.
"""

from __future__ import annotations

import contextlib
import pickle
import signal
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, TypeVar

from .errors import UNEXPECTED, InputError
from .option_names import is_typed, speak_as
from .validation import whole

T = TypeVar("T")
R = TypeVar("R")
Job = tuple[int, Any]  # index, item
_AHEAD = 2  # jobs in progress for each worker: one at work, one waiting
_UNKNOWN = 16  # number of workers assumed for an executor that does not give it


@dataclass(frozen=True)
class JobError:
    """A job that failed: its index, what happened in one sentence, and the exit code of that."""

    index: int
    sentence: str
    exit_code: int = UNEXPECTED

    @classmethod
    def of(cls, index: int, error: BaseException) -> JobError:
        """The error as a sentence: its own message if that is meant for the user."""
        code = getattr(error, "exit_code", None)
        if isinstance(code, int):
            return cls(index, str(error), code)
        words = " ".join(str(error).split()) or "no message"
        sentence = f"{type(error).__name__}: {words}"
        if isinstance(error, BrokenExecutor):
            sentence = "its worker process died (out of memory, or a crash in compiled code)."
        return cls(index, sentence, 2 if isinstance(error, OSError) else UNEXPECTED)


def run_jobs(
    function: Callable[[T], R],
    items: Iterable[T],
    *,
    executor: Executor | None = None,
    jobs: int = 1,
) -> Generator[tuple[int, R | JobError]]:
    """``(index, function(item))`` for each item, in the order in which they are done; a JobError
    where it raised, or its process died. ``jobs`` are processes to start (1: none), or the workers
    of an executor that does not give their number."""
    jobs, numbered = whole(jobs, "jobs", 1), enumerate(items)
    if executor is not None:
        workers = jobs if jobs > 1 else getattr(executor, "_max_workers", None) or _UNKNOWN
        return _spread(function, numbered, executor, _AHEAD * workers)
    if jobs == 1:
        return (_work(function, job) for job in numbered)
    try:
        pickle.dumps(function)
    except Exception as error:
        raise InputError(f"the job cannot be sent to another process: {error}.") from None
    return _on_processes(function, numbered, jobs)


def _work(function: Callable[[Any], Any], job: Job) -> tuple[int, Any]:
    """The index of a job, and its result or error (in the worker)."""
    index, item = job
    try:
        return index, function(item)
    except Exception as error:
        return index, JobError.of(index, error)


def _spread(
    function: Callable[[Any], Any],
    jobs: Iterator[Job],
    executor: Executor,
    ahead: int,
    lost: list[Job] | None = None,
) -> Generator[tuple[int, Any]]:
    """Results from an executor. If it breaks: with ``lost``, the unfinished jobs go there and
    no more are read from ``jobs``; without, each job that it refuses is an error."""
    waiting: dict[Future[Any], Job] = {}
    try:
        while True:
            while not lost and len(waiting) < ahead and (job := next(jobs, None)):
                try:
                    future = executor.submit(_work, function, job)
                except Exception as error:  # it is broken or shut down
                    future = Future()
                    future.set_exception(error)
                waiting[future] = job
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                job, gone = waiting.pop(future), future.cancelled()
                error = CancelledError("cancelled") if gone else future.exception()
                if error is None:
                    yield future.result()
                elif lost is not None and isinstance(error, BrokenExecutor):
                    lost.append(job)
                else:
                    yield job[0], JobError.of(job[0], error)
    finally:
        for future in waiting:
            future.cancel()


def _on_processes(
    function: Callable[[Any], Any], numbered: Iterator[Job], jobs: int
) -> Generator[tuple[int, Any]]:
    """Results from our own processes. If one dies, the lost jobs are run again one by one."""
    while True:
        lost: list[Job] = []
        with _processes(jobs) as pool:
            yield from _spread(function, numbered, pool, _AHEAD * jobs, lost)
        for job in lost:
            with _processes(1) as pool:
                yield from _spread(function, iter([job]), pool, 1)
        if not lost:
            return


@contextlib.contextmanager
def _processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """New processes; ended at once if an interrupt or an early exit leaves the block."""
    # spawn: a fork would copy locks of threads (numba, BLAS) in an undefined state
    pool = ProcessPoolExecutor(count, get_context("spawn"), _begin, (is_typed(),))
    try:
        yield pool
    except BaseException:
        workers = list((getattr(pool, "_processes", None) or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()
        raise
    pool.shutdown()


def _begin(typed: bool) -> None:
    """Ignore Ctrl-C, which the process that started the workers handles."""
    speak_as(typed)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
