"""How long the checks of many designs take; opt-in: pytest -m slow tests/benchmarks."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest

from lugrectl.linear import check_designs

pytestmark = pytest.mark.slow
N = 100_000


@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("drives", ["one drive", "a drive each"])
def test_checks_of_1e5_designs(loop, drives, record_property):
    """The aim is 20 ms or less on two cores; the figure is printed, not asserted."""
    rng = np.random.default_rng(0)

    def spread(low, high, size=N):
        return 10 ** rng.uniform(low, high, size)

    size = N if drives == "a drive each" else 1
    p = SimpleNamespace(
        J=spread(-4, -1, size), sigma0=spread(1, 4, size), sigma1=spread(-2, 1, size)
    )
    gains = spread(-1, 3), spread(-2, 4), spread(-3, 1)
    K2, times = rng.normal(0, 30, N), []
    for _ in range(30):
        start = time.perf_counter()
        checks = check_designs(p, *gains, K2=K2, loop=loop)
        times.append(1e3 * (time.perf_counter() - start))
    record_property("ms", min(times))
    print(f"\n{loop}, {drives}: {min(times):.1f} ms best, {np.median(times):.1f} ms median")
    assert checks.stable.size == N
