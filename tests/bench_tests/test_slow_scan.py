"""Half the difference of two directions is friction at that speed, half the sum is cogging."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..drives.bench import Drive, kept, speed_loop

DRIVE = Drive(cogging=0.04)
V = 1.5


def scan(turns: float = 1.3) -> dict:
    rows = int(turns * 2 * np.pi / V / DRIVE.dt)
    way = np.r_[np.full(rows, V), np.zeros(150), np.full(rows, -V), np.zeros(150)]
    return DRIVE.run(speed_loop(way, DRIVE.J), len(way))


def test_friction_and_the_harmonics_of_the_turn():
    (test,) = lg.balance(kept(scan(), "theta")).bench_tests
    assert test.kind == "slow_scan"
    right = {"Fc": DRIVE.Fc + DRIVE.Fv * V, "cogging.7": DRIVE.cogging}
    for name, value in right.items():
        assert test.values[name].may_be(value), name
        assert abs(test.values[name].value / value - 1) < 0.03, name
    theta, cogging, friction = np.array(test.table.rows).T
    assert np.ptp(theta) > 6.0
    assert np.corrcoef(cogging, np.sin(7 * theta))[0, 1] > 0.99
    assert friction == pytest.approx(right["Fc"], rel=0.05)


def test_less_than_a_turn_is_no_scan():
    assert not lg.balance(kept(scan(0.6), "theta")).bench_tests
