"""A staircase of speeds gives the friction curve, with Fs and vs where a plateau is slow enough."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..drives.bench import Drive, kept, speed_loop

DRIVE = Drive(vs=0.5, counts=65536)


def stairs(slowest: float) -> dict:
    levels = np.geomspace(slowest, 20.0, 8)
    reference = np.repeat(np.r_[levels, -levels], 350)
    log = DRIVE.run(speed_loop(reference, DRIVE.J), len(reference))
    return kept(log, "theta")


def test_the_friction_curve():
    (test,) = lg.balance(stairs(0.2)).bench_tests
    assert test.kind == "staircase"
    for name in ("Fc", "Fv", "Fs", "vs"):
        found, right = test.values[name], getattr(DRIVE, name)
        assert found.may_be(right) and abs(found.value / right - 1) < 0.05, name
    assert len(test.table.rows) == 16


def test_fast_plateaus_say_nothing_of_static_friction():
    (test,) = lg.balance(stairs(2.5)).bench_tests
    assert set(test.values) == {"Fc", "Fv"} and "slow and steady enough for Fs" in test.text
    assert test.values["Fc"].value == pytest.approx(DRIVE.Fc, rel=0.03)


def test_short_plateaus_of_a_slow_log_are_plateaus():
    """At 10 Hz a settled plateau of 2 s has five rows or so."""
    levels = np.repeat(np.r_[1.0:9.0, -1.0:-9.0:-1.0], 20)
    u = np.sign(levels) * DRIVE.Fc + DRIVE.Fv * levels
    log = {"t": np.arange(len(levels)) / 10, "u": u, "w": levels}
    noise = np.random.default_rng(3).normal(0, 1e-3, (2, len(levels)))
    log = log | {"u": u + noise[0], "w": levels + noise[1]}
    (test,) = lg.balance(log).bench_tests
    assert test.kind == "staircase" and test.values["Fc"].may_be(DRIVE.Fc)
    assert test.values["Fc"].value == pytest.approx(DRIVE.Fc, rel=0.02)


def test_in_one_direction_friction_and_a_constant_torque_are_one_number():
    levels = np.repeat(np.r_[1.0:9.0], 400)
    w = np.convolve(np.r_[np.zeros(80), levels], np.ones(80) / 80, "valid")[: len(levels)]
    u = DRIVE.J * np.gradient(w, 2e-3) + DRIVE.Fc + DRIVE.Fv * w + 0.1
    (test,) = lg.balance({"t": 2e-3 * np.arange(len(w)), "u": u, "w": w}).bench_tests
    assert "Fc" not in test.values and " Fc + constant_torque " in test.text
    assert test.values["Fc + constant_torque"].value == pytest.approx(DRIVE.Fc + 0.1, rel=0.01)
