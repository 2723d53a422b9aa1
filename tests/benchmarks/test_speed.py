"""How many times faster one way is than another, both in one process and alternately.

Opt-in: pytest -m slow -s tests/benchmarks. No assertion is of seconds, which are the machine's.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import Lanes, TraceError, adaptive_run, batch_run, memo
from lugrectl.engine.backend import has_wide

from ..cases.systems import DT, torque
from ..cases.wide import WIDE, plant
from ..conftest import there
from . import item

pytestmark = pytest.mark.slow
P = lg.table1()
WAYS = ["c", "numba", "python"]


def shortest(run: Callable[[], Any], times: int) -> float:
    """Processor seconds of the quickest of so many runs."""
    taken = []
    for _ in range(times):
        start = time.process_time()
        run()
        taken.append(time.process_time() - start)
    return min(taken)


def ratio(
    slow: Callable[[], Any], fast: Callable[[], Any], times: int, share: float = 1.0
) -> float:
    """How many times faster ``fast`` is; ``slow`` does this share of its work."""
    fast()
    made = shortest(slow, max(times // 5, 1)) / shortest(fast, times) / share
    print(f"\n{made:.1f} times faster")
    return made


def compiled_by(way: str, place: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    made_by = None if way == "python" else there(way)
    monkeypatch.setattr(place, "compiler", lambda: made_by)
    monkeypatch.setattr(memo, "_traced", {})


@pytest.mark.parametrize(("way", "aim"), [("c", 1500), ("numba", 1500), ("python", 20)])
def test_a_simulation_against_python_control_with_lsoda(way, aim, monkeypatch):
    """At the same tolerance, and right to it."""
    compiled_by(way, adaptive_run, monkeypatch)
    loop, options = item.loop(), {"rtol": 1e-6, "atol": 1e-9}
    given = (loop, item.t, item.r, item.x0)
    assert item.worst(lg.simulate(*given).states, item.exact()) < 1e-6

    def theirs() -> Any:
        more = {"solve_ivp_method": "LSODA", "solve_ivp_kwargs": options}
        return ct.input_output_response(*given, **more)

    assert ratio(theirs, lambda: lg.simulate(*given), 5) >= aim


@pytest.mark.parametrize("way", WAYS)
def test_sampled_blocks_against_calling_them_at_their_ticks(way, monkeypatch):
    compiled_by(way, adaptive_run, monkeypatch)
    low = replace(P, sigma0=0.9 * P.sigma0, Fc=0.9 * P.Fc, Fs=0.9 * P.Fs)
    parts = [lg.sampled(b, 1e-3) for b in (lg.pi(1.6, 0.16), lg.proposed_observer(low))]
    net, t = [lg.plant(P), lg.error(), lg.compensation(), *parts], 1e-3 * np.arange(10_001)
    r = np.sin(2 * np.pi * t)
    fast = lg.simulate(net, t, {"r": r})

    def called() -> Any:
        with monkeypatch.context() as m:
            m.setattr("lugrectl.simulation.response.compiled", _cannot)
            return lg.simulate(net, t[:1001], {"r": r[:1001]})

    np.testing.assert_allclose(fast.outputs[:, :1001], called().outputs, rtol=1e-6, atol=1e-9)
    aim = 2 if way == "python" else 20
    assert ratio(called, lambda: lg.simulate(net, t, {"r": r}), 5, share=0.1) > aim


def _cannot(*_):
    raise TraceError("not asked for")


@pytest.mark.skipif(not has_wide(), reason="this machine computes one at a time")
@pytest.mark.parametrize("effect", WIDE)
def test_several_lanes_at_once_against_one_after_another(effect, monkeypatch):
    """A loop that the compiler could not turn into several at once would be no quicker."""
    made = Lanes(plant("lugre", effect), backend="c")
    p = np.tile(made.defaults, (64, 1))
    x0 = 1e-3 * np.random.default_rng(1).standard_normal((64, len(made.states)))
    u = torque(1000)[:, : len(made.inputs)]

    def run(least: int) -> Any:
        monkeypatch.setattr(batch_run, "LEAST_WIDE", least)
        return made.run(x0, np.zeros(64, int), 1000, u, p, dt=DT)

    assert ratio(lambda: run(1000), lambda: run(1), 10) > 1.1


def axis_log(n: int) -> dict[str, np.ndarray]:
    """n samples at 1 kHz of an inertia with friction, u, theta and w."""
    noise, t = np.random.default_rng(0), np.arange(n) * 1e-3
    waves = [(6.0, 0.31), (4.0, 0.83), (2.0, 1.7), (1.5, 3.1)]
    w = sum(a * np.sin(2 * np.pi * f * t) for a, f in waves)
    acceleration = sum(2 * np.pi * f * a * np.cos(2 * np.pi * f * t) for a, f in waves)
    theta = -sum(a / (2 * np.pi * f) * np.cos(2 * np.pi * f * t) for a, f in waves)
    u = 2e-3 * acceleration + 0.05 * np.tanh(w / 0.05) + 3e-3 * w
    more, step = noise.standard_normal((2, n)), 2 * np.pi / 20_000
    rounded = step * np.round(theta / step)
    return {"t": t, "u": u + 1e-3 * more[0], "w": w + 0.02 * more[1], "theta": rounded}


def test_the_plain_answer_of_a_log_33_times_as_long_takes_less_than_25_times_as_long():
    """Windows are limited in number, so that only the work on every sample grows."""
    model = lg.Model.of(J=2e-3, friction="coulomb", Fc=0.05, Fv=3e-3)
    short, long = axis_log(30_000), axis_log(1_000_000)
    assert ratio(lambda: lg.balance(long, model), lambda: lg.balance(short, model), 3) < 25
