"""A thousand parameter sets of the work item, and a stream of 1e5 members.

Opt-in: pytest -m slow -s tests/benchmarks.
"""

from __future__ import annotations

import os
import time
import tracemalloc
from typing import Any

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine.runtime.backend import threads

from ..cases.ensembles import lag
from . import item
from .timing import shortest

pytestmark = pytest.mark.slow
L, AIM = 1000, 1.5  # members, s on two cores


def table() -> dict[str, np.ndarray]:
    rng, p = np.random.default_rng(0), item.plant
    return {
        "plant.sigma0": p.sigma0 * rng.uniform(0.8, 1.2, L),
        "plant.Fc": p.Fc * rng.uniform(0.9, 1.0, L),
        "plant.Fs": p.Fs * rng.uniform(1.0, 1.1, L),
        "pi.kp": item.KP * rng.uniform(0.8, 1.2, L),
    }


@pytest.mark.parametrize("outputs", [["w"], None], ids=["w", "all outputs"])
def test_a_thousand_parameter_sets(outputs: Any, record_property: Any) -> None:
    pytest.importorskip("numba")
    cores = min(threads(), os.cpu_count() or 1)
    loop, sets = item.loop(), table()

    def many() -> lg.Sweep:
        return lg.sweep(loop, item.t, item.r, sets, x0=item.x0, outputs=outputs)

    def one(row: dict[str, float]) -> Any:
        return lg.simulate(loop, item.t, item.r, item.x0, params=row)

    found = many()
    assert not found.failed
    for i in (0, 500, 999):
        alone = one({k: v[i] for k, v in sets.items()})
        assert np.array_equal(found["w"][i], alone.outputs[alone.output_labels.index("w")])
    del found
    rows = [{k: v[i] for k, v in sets.items()} for i in range(20)]
    single = shortest(lambda: [one(row) for row in rows], 3) / len(rows)
    quiet = os.getloadavg()[0] < 0.3 * cores  # else the clock also counts the others' work
    taken, start = shortest(many, 5), time.process_time()
    many()
    worked = (time.process_time() - start) / cores
    print(
        f"\n{L} members on {cores} cores: {taken:.2f} s, {L * single / taken:.2f} times faster "
        f"than simulate one by one ({1e3 * single:.2f} ms each); {worked:.2f} s of each core"
    )
    record_property("seconds", taken)
    assert worked <= AIM * max(2 / cores, 1)
    assert not quiet or taken <= AIM * max(2 / cores, 1)


def test_a_stream_of_1e5_members(record_property: Any) -> None:
    """Memory stays that of the chunks under way: 1e5 results of two outputs would be 162 MB."""
    pytest.importorskip("numba")
    t, many = np.linspace(0, 1, 101), {"lag.gain": np.linspace(0.5, 2, 100_000)}
    block = lag()
    list(lg.sweep_chunks(block, t, 1.0, {"lag.gain": np.ones(2)}))
    tracemalloc.start()
    start, final = time.perf_counter(), np.full(100_000, np.nan)
    for part in lg.sweep_chunks(block, t, 1.0, many):
        final[part.members] = part["y"][:, -1]
    taken, peak = time.perf_counter() - start, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    print(f"\n1e5 members of {len(t)} samples streamed: {taken:.1f} s, {peak / 1e6:.1f} MB at most")
    record_property("MB", peak / 1e6)
    assert np.allclose(final, many["lag.gain"] * (1 - np.exp(-5.0)), atol=1e-5)
    assert peak < 20e6
