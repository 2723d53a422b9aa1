"""How many threads linear algebra takes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # to be set before NumPy is loaded


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Linear algebra inside takes one thread, where threadpoolctl is there to tell it.

    On small matrices its threads wait longer for each other than they work, several times as
    long where other processes want the processors. The setting is the whole process's: where
    another thread ends its own first, the rest only takes longer.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        yield
        return
    with threadpool_limits(limits=1, user_api="blas"):
        yield
