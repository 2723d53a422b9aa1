"""Steps of the torque give the inertia beside friction, whatever of the motion was recorded."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..drives.bench import Drive, held, kept, stale

DRIVE = Drive()
LEVELS = [0.5, 0.0, -0.5, 0.0, 0.35, -0.35, 0.0]


def found(log: dict):
    tests = {test.kind: test for test in lg.balance(log).bench_tests}
    return tests["steps_and_pulses"]


@pytest.mark.parametrize("seen", ["theta", "w", "stale"])
def test_inertia_and_friction(seen):
    log = DRIVE.run(held(LEVELS, 150), 3000)
    made = kept(log, seen) if seen != "stale" else {**kept(log), "w": stale(log)}
    test = found(made)
    for name in ("J", "Fc", "Fv"):
        value, right = test.values[name], getattr(DRIVE, name)
        low, high = value.ci95
        assert low <= right <= high and low < high and abs(value.value / right - 1) < 0.03, name


def test_a_measured_torque_has_noise():
    log = DRIVE.run(held(LEVELS, 150), 3000)
    log["u"] = log["u"] + np.random.default_rng(2).normal(0, 0.01, 3000)
    assert abs(found(kept(log, "theta")).values["J"].value / DRIVE.J - 1) < 0.03


def test_a_late_torque_is_counted():
    log = DRIVE.run(held(LEVELS, 150), 3000)
    log["u"] = np.roll(log["u"], -2)  # logged 4 ms before it acts
    assert abs(found(kept(log, "theta")).values["J"].value / DRIVE.J - 1) < 0.03


def test_a_loop_that_follows_is_no_step_test():
    drive = Drive()
    log = drive.run(lambda k, theta, w: 0.4 * (2 * np.sin(0.01 * k) - w), 3000)
    kinds = [test.kind for test in lg.balance(kept(log, "theta")).bench_tests]
    assert "steps_and_pulses" not in kinds
