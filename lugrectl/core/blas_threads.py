"""The number of threads used by linear algebra."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # to be set before NumPy is loaded
_THREADS = ("OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS", *BLAS)


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Linear algebra inside uses one thread, if threadpoolctl is installed: on small matrices the
    threads wait for each other longer than they work. The setting holds for the whole process."""
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
