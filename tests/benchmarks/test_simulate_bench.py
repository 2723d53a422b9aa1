"""One simulation: how many times faster than python-control, and than a C program of the loop.

Opt-in: pytest -m slow -s tests/benchmarks. Every figure is processor time, so that other work
on the machine counts little, in one process with what it is compared with.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine.runtime import adaptive_run
from lugrectl.engine.runtime.memo import compiled
from lugrectl.engine.tracing.network import Net

from ..conftest import there
from . import c_loop, item
from .timing import shortest

pytestmark = [pytest.mark.slow, pytest.mark.benchmark(timer=time.process_time)]


def simulate() -> Callable[[], Any]:
    """The work item, compiled; its result is right to 1e-6."""
    loop = item.loop()

    def run() -> Any:
        return lg.simulate(loop, item.t, item.r, item.x0)

    assert item.worst(run().states, item.exact()) < 1e-6
    return run


@pytest.fixture(scope="module")
def python_control() -> float:
    """Seconds that python-control takes with LSODA at 1e-6; run once, as it takes many."""
    loop, options = item.loop(), {"rtol": 1e-6, "atol": 1e-9}
    start = time.process_time()
    response = ct.input_output_response(
        loop,
        item.t,
        item.r,
        item.x0,
        solve_ivp_method="LSODA",
        solve_ivp_kwargs=options,
    )
    taken = time.process_time() - start
    error = item.worst(np.asarray(response.states), item.exact())
    print(f"\npython-control, LSODA at 1e-6: {taken:.2f} s, error {error:.1e}")
    return taken


@pytest.fixture(params=["c", "numba", "python"])
def backend(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    made_by = None if request.param == "python" else there(request.param)
    monkeypatch.setattr(adaptive_run, "compiler", lambda: made_by)
    monkeypatch.setattr("lugrectl.engine.runtime.memo._traced", {})
    yield request.param


AIMS = {"c": (1500, 200), "numba": (1500, 200), "python": (20, 5)}


def test_against_python_control(benchmark: Any, python_control: float, backend: str) -> None:
    aim, rounds = AIMS[backend]
    benchmark.pedantic(simulate(), rounds=rounds, warmup_rounds=2)
    taken = benchmark.stats.stats.median  # python-control's time is not the shortest of many
    ratio = benchmark.extra_info["times faster"] = python_control / taken
    print(f"\n{backend}: {1e3 * taken:.2f} ms, {ratio:.0f} times faster (aim {aim})")
    assert ratio >= aim


def test_against_c(benchmark: Any, tmp_path: Any) -> None:
    pytest.importorskip("numba")
    if c_loop.compiler() is None:
        pytest.skip("no C compiler")
    program, run = c_loop.compiled(tmp_path), simulate()
    states, _ = program(1e-6, 1)
    assert item.worst(states, item.exact()) < 1e-6
    in_c = min(program(1e-6, 5)[1] for _ in range(10))
    benchmark.pedantic(run, rounds=200, warmup_rounds=2)
    in_c = min([in_c, *(program(1e-6, 5)[1] for _ in range(10))])
    taken = benchmark.stats.stats.min
    ratio = benchmark.extra_info["of the C program's time"] = taken / in_c
    print(f"\nC {1e3 * in_c:.2f} ms, simulate {1e3 * taken:.2f} ms: {ratio:.2f} times C (aim 2.0)")
    assert ratio <= 2.0


def torque(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """A drive sent to and fro each second, with a ripple: reversals, and 4 rad/s in between."""
    t = np.arange(samples) * 1e-3
    wave = 0.36 * np.tanh(4 * np.sin(np.pi * t)) + 0.02 * np.sin(2 * np.pi * 7 * t)
    return t, np.vstack([wave, 0 * t])


def test_free_simulation_of_1e5_samples(benchmark: Any) -> None:
    """Torque in, held; theta, w, z and F out: the engine alone, and the whole of ``simulate``."""
    pytest.importorskip("numba")
    plant, (t, u) = lg.plant(lg.table1()), torque(100_000)
    engine, x0 = compiled(Net.of(plant)), np.zeros(3)
    p = engine.program.defaults

    def run() -> np.ndarray:
        states = engine.run(t, u, x0, p, hold=True, rtol=1e-6).states
        engine.outputs(t, states, u, p)
        return states

    assert 2.0 < np.max(np.abs(run()[1])) < 10.0
    whole = shortest(lambda: lg.simulate(plant, t, u, hold=True), 30, time.process_time)
    benchmark.pedantic(run, rounds=40, warmup_rounds=1)
    taken = benchmark.stats.stats.min
    print(f"\n1e5 samples: engine {1e3 * taken:.1f} ms, simulate {1e3 * whole:.1f} ms (aim 15)")
    assert taken <= whole <= 0.015
