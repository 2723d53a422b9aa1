"""How long the plain answer takes, compared with the size of the log; opt-in: pytest -m slow."""

from __future__ import annotations

import time
from statistics import median

import numpy as np
import pytest

import lugrectl as lg

pytestmark = pytest.mark.slow
MODEL = {
    "name": "axis",
    "motion": "rotary",
    "plant": {"J": 2e-3},
    "friction": {"model": "coulomb", "Fc": 0.05, "Fv": 3e-3},
}


def log_of(n: int) -> dict[str, np.ndarray]:
    """n samples at 1 kHz of an inertia with friction, u, theta and w."""
    noise, t = np.random.default_rng(0), np.arange(n) * 1e-3
    waves = [(6.0, 0.31), (4.0, 0.83), (2.0, 1.7), (1.5, 3.1)]
    w = sum(a * np.sin(2 * np.pi * f * t) for a, f in waves)
    acceleration = sum(2 * np.pi * f * a * np.cos(2 * np.pi * f * t) for a, f in waves)
    theta = -sum(a / (2 * np.pi * f) * np.cos(2 * np.pi * f * t) for a, f in waves)
    u = 2e-3 * acceleration + 0.05 * np.tanh(w / 0.05) + 3e-3 * w
    step = 2 * np.pi / 20_000
    return {
        "t": t,
        "u": u + 1e-3 * noise.standard_normal(n),
        "w": w + 0.02 * noise.standard_normal(n),
        "theta": step * np.round(theta / step),
    }


def seconds(n: int, times: int) -> float:
    taken = []
    for _ in range(times):
        log, start = log_of(n), time.process_time()
        lg.balance(log, MODEL)
        taken.append(time.process_time() - start)
    return median(taken)


def test_a_log_33_times_as_long_takes_less_than_25_times_as_long(record_property):
    """Windows are limited in number, so that only the work on every sample grows."""
    seconds(30_000, 1)  # imports and first calls
    short, long = seconds(30_000, 3), seconds(1_000_000, 1)
    record_property("s of 3e4 samples", short)
    record_property("s of 1e6 samples", long)
    print(f"\n3e4 samples: {short:.2f} s, 1e6 samples: {long:.2f} s, ratio {long / short:.1f}")
    assert long < 25 * short
