"""A swing gives the length, the damping and the dry friction, each for a unit of inertia."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..drives.bench import Drive, kept

DRIVE = Drive(J=0.02, Fc=0.004, Fs=0.005, Fv=0.002, gravity=0.5)
RIGHT = {
    "length": 9.81 * DRIVE.J / DRIVE.gravity,
    "gravity/J": DRIVE.gravity / DRIVE.J,
    "Fc/J": DRIVE.Fc / DRIVE.J,
    "Fv/J": DRIVE.Fv / DRIVE.J,
}


@pytest.mark.parametrize("channel", ["theta", "w"])
def test_the_whole_swing_is_fitted(channel):
    log = DRIVE.run(lambda k, theta, w: 0.0, 5000, x=1.1)
    (test,) = lg.balance(kept(log, channel)).bench_tests
    assert test.kind == "free_swing"
    for name, right in RIGHT.items():
        found = test.values[name]
        assert found.may_be(right) and abs(found.value / right - 1) < 0.03, name


def test_a_driven_oscillation_is_no_free_swing():
    drive = Drive()
    log = drive.run(lambda k, theta, w: 0.5 * np.sin(0.02 * k) * np.exp(-k / 1500), 4000)
    assert "free_swing" not in [test.kind for test in lg.balance(kept(log, "theta")).bench_tests]
