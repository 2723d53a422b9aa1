"""The shortest of several times."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


def shortest(
    run: Callable[[], Any], times: int, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Seconds of the quickest of so many runs."""
    taken = []
    for _ in range(times):
        start = clock()
        run()
        taken.append(clock() - start)
    return min(taken)


def milliseconds(run: Callable[[], Any], times: int) -> float:
    """Milliseconds of the quickest of so many runs, after one that counts for nothing."""
    run()
    return 1e3 * shortest(run, times)
