"""What is no bench test gets no line, and no log stops the plain answer."""

from __future__ import annotations

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.report import plain_text

from ..drives.bench import Drive, held, kept, speed_loop


def wandering(t: np.ndarray) -> np.ndarray:
    return 2.0 * np.sin(2 * np.pi * 0.3 * t) + np.sin(2 * np.pi * 0.83 * t + 1)


def test_an_ordinary_log_has_none():
    drive = Drive()
    t = drive.dt * np.arange(5000)
    plain = lg.balance(kept(drive.run(speed_loop(wandering(t), drive.J), len(t)), "theta"))
    assert plain.bench_tests == () and "bench_tests" not in plain.summary()


def test_the_line_is_the_first_of_the_plain_answer_and_is_in_json():
    log = kept(Drive().run(held([0.5, 0.0, -0.5, 0.0], 150), 2400), "theta")
    plain = lg.balance(log)
    lines = plain_text(plain).splitlines()
    assert "coast-downs: Fc/J" in lines[1]
    made = json.loads(plain.to_json())["bench_tests"]
    assert [test["kind"] for test in made] == ["coast_down", "steps_and_pulses"]
    assert set(made[1]["values"]) == {"J", "Fc", "Fv"}
    assert all(low < high for low, high in (v["ci95"] for v in made[1]["values"].values()))


@pytest.mark.parametrize("seed", range(12))
def test_no_log_stops_it(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 400))
    signals = [rng.normal(size=n), np.zeros(n), np.cumsum(rng.normal(size=n)), 1e9 * np.ones(n)]
    u, x = (signals[i].copy() for i in rng.integers(0, 4, 2))
    x[rng.integers(0, n, 3)] = np.nan
    channel = ("theta", "w")[seed % 2]
    lg.balance({"t": 1e-3 * np.arange(n), "u": u, channel: x})
