"""Independent jobs in this process, on processes of this machine, or on any executor.

A bounded number of chunks is in progress, so that neither items nor results accumulate.
"""

from __future__ import annotations

import contextlib
import pickle
import signal
from collections.abc import Callable, Generator, Iterable, Iterator, Sized
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
from itertools import islice
from multiprocessing import get_context
from typing import Any, TypeVar

from .errors import UNEXPECTED, InputError
from .option_names import is_typed, speak_as
from .validation import whole

T = TypeVar("T")
R = TypeVar("R")
Progress = Callable[[float, str], None]
Chunk = list[tuple[int, Any]]  # (index, item)
_AHEAD = 2  # chunks in progress for each worker: one at work, one waiting
_UNKNOWN = 16  # number of workers assumed for an executor that does not give it


@dataclass(frozen=True)
class JobError:
    """A job that failed: its index, what happened in one sentence, and an exit code: the error's
    own, 2 if a file cannot be read, 70 for any other exception or a worker process that died."""

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
        return cls(index, sentence, 2 if isinstance(error, OSError) else UNEXPECTED)


def run_jobs(
    function: Callable[[T], R],
    items: Iterable[T],
    *,
    executor: Executor | None = None,
    jobs: int = 1,
    chunk: int = 1,
    progress: Progress | None = None,
) -> Iterator[tuple[int, R | JobError]]:
    """``(index, function(item))`` for each item, in the order in which they are done; a job that
    raised yields a ``JobError``, and if a worker process dies, only its item is lost.

    Without ``executor``, ``jobs`` processes are started (1: none), to which ``function`` must be
    picklable; else it is the number of its workers if it does not give it itself. ``chunk`` items
    are one task. Ctrl-C yields what is finished first."""
    jobs, chunk = whole(jobs, "jobs", 1), whole(chunk, "chunk", 1)
    numbered = enumerate(items)
    parts = iter(lambda: list(islice(numbered, chunk)), [])
    if executor is not None:
        workers = jobs if jobs > 1 else getattr(executor, "_max_workers", None) or _UNKNOWN
        found = _spread(function, parts, executor, _AHEAD * workers)
    elif jobs == 1:
        found = (pair for part in parts for pair in _one_by_one(function, part))
    else:
        try:
            pickle.dumps(function)
        except Exception as error:
            raise InputError(f"the job cannot be sent to another process: {error}.") from None
        found = _on_processes(function, parts, jobs)
    return _reported(found, len(items) if isinstance(items, Sized) else None, progress)


def _reported(
    found: Generator[tuple[int, Any]], total: int | None, progress: Progress | None
) -> Iterator[tuple[int, Any]]:
    with contextlib.closing(found):
        for done, pair in enumerate(found, 1):
            yield pair  # first: an interrupt during the report must not lose the result
            if progress is not None:
                fraction = done / total if total else 0.0
                progress(fraction, f"{done} of {total}" if total else f"{done} done")


def _one_by_one(function: Callable[[Any], Any], chunk: Chunk) -> Iterator[tuple[int, Any]]:
    for index, item in chunk:
        try:
            result = function(item)
        except Exception as error:
            result = JobError.of(index, error)
        yield index, result


def _work(function: Callable[[Any], Any], chunk: Chunk) -> list[tuple[int, Any]]:
    """Run the function on each item of a chunk (in the worker)."""
    return list(_one_by_one(function, chunk))


def _spread(
    function: Callable[[Any], Any],
    chunks: Iterator[Chunk],
    executor: Executor,
    ahead: int,
    lost: list[Chunk] | None = None,
) -> Generator[tuple[int, Any]]:
    """Results from an executor. If it breaks: with ``lost``, the unfinished items go there and
    no more are read from ``chunks``; without, each job that it refuses is an error."""
    waiting: dict[Future[Any], Chunk] = {}
    try:
        while True:
            while not lost and len(waiting) < ahead and (part := next(chunks, None)):
                try:
                    future = executor.submit(_work, function, part)
                except Exception as error:  # it is broken or shut down
                    future = Future()
                    future.set_exception(error)
                waiting[future] = part
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield from _collected(future, waiting.pop(future), lost)
    except KeyboardInterrupt:
        for future in waiting:
            future.cancel()
        for future in [f for f in waiting if f.done() and not f.cancelled()]:
            yield from _collected(future, waiting.pop(future), None)
        raise
    finally:
        for future in waiting:
            future.cancel()


def _collected(
    future: Future[Any], part: Chunk, lost: list[Chunk] | None
) -> Iterator[tuple[int, Any]]:
    error = CancelledError("cancelled") if future.cancelled() else future.exception()
    if error is None:
        yield from future.result()
    elif lost is not None and isinstance(error, BrokenExecutor):
        lost.append(part)
    else:
        for index, _ in part:
            yield index, JobError.of(index, error)


def _on_processes(
    function: Callable[[Any], Any], chunks: Iterator[Chunk], jobs: int
) -> Generator[tuple[int, Any]]:
    """Results from our own processes. If one dies, the lost items are run again one by one."""
    lost: list[Chunk] = []
    while True:
        with _processes(jobs) as pool:
            yield from _spread(function, chunks, pool, _AHEAD * jobs, lost)
        if not lost:
            return
        pairs = [pair for part in lost for pair in part]
        lost.clear()
        while pairs:
            died: list[Chunk] = []
            with _processes(1) as pool:
                while pairs and not died:
                    yield from _spread(function, iter([[pairs.pop(0)]]), pool, 1, died)
            for index, _ in (pair for part in died for pair in part):
                sentence = "its worker process died (out of memory, or a crash in compiled code)."
                yield index, JobError(index, sentence)


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
    """Ignore Ctrl-C, which the process that started the workers handles; it may be the command
    line."""
    speak_as(typed)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
