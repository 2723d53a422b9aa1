"""Stretches of uniform time: what a logger that writes in bursts has not lost."""

from __future__ import annotations

import numpy as np

from lugrectl.record import read_log, stretches


def bursts():
    """Rows of about 2 ms, with a pause of about 12 ms after every eighth."""
    rng = np.random.default_rng(0)
    steps = np.where(np.arange(400) % 8, 2, 12) + rng.integers(0, 2, 400)
    t = 1e-3 * np.cumsum(steps)
    return {"t": t, "u": np.cos(6.0 * t), "w": np.sin(6.0 * t)}


def test_a_pause_of_a_logger_is_no_loss():
    (found,), _ = stretches([read_log(bursts())])
    assert found.ok.all()
    assert np.abs(found.w - np.sin(6.0 * found.t)).max() < 1e-3


def test_samples_that_are_missing_are_not_used():
    log = bursts()
    log["u"][100:103] = np.nan
    (found,), _ = stretches([read_log(log)])
    at = (found.t > log["t"][99] + found.dt) & (found.t < log["t"][103] - found.dt)
    assert at.any() and not found.ok[at].any()
    assert found.ok.mean() > 0.95


def test_a_lost_row_of_an_even_clock_is_bridged_and_three_are_not():
    t = 1e-3 * np.delete(np.arange(1000), [300, 600, 601, 602])
    (found,), _ = stretches([read_log({"t": t, "u": np.cos(t), "w": np.sin(6.0 * t)})])
    assert found.ok[300] and not found.ok[601]
