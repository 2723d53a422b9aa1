"""The number of threads used by linear algebra."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # to be set before NumPy is loaded
_THREADS = ("OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS", *BLAS)


def processors() -> int:
    given = getattr(os, "sched_getaffinity", None)  # not on every system
    return len(given(0)) if given else os.cpu_count() or 1


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Linear algebra on one thread, if threadpoolctl is there: more only wait on small matrices."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        yield
        return
    with threadpool_limits(limits=1, user_api="blas"):
        yield


@contextlib.contextmanager
def one_thread_each(on: bool = True) -> Iterator[None]:
    """Processes started inside use one numerical thread, unless the user set another number."""
    added = [name for name in _THREADS if on and name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
