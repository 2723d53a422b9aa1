"""Rows are left out only where the motion contradicts them: rests, peaks and reversals stay."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..drives.bench import Drive, kept, ramps, speed_loop


def left_out(found):
    """What was said of torques that were left out."""
    return [x for x in (*found.reading, *found.notes) if x.startswith("u ") and "left out" in x]


def test_rests_without_torque_and_peaks_at_breakaway_stay():
    """The balance knows ramps and coasts of some rows only: it extrapolates to the others."""
    drive = Drive(counts=16384)
    log = drive.run(ramps(0.08, 0.04, 250, drive.dt), 8000)
    assert not left_out(lg.balance(kept(log, "theta")))


@pytest.fixture(scope="module")
def scan():
    """Slow turns both ways; w is a difference over 10 ms, late by half of that."""
    drive, V = Drive(vs=0.5, dt=1e-3, counts=65536, cogging=0.02), np.full(4500, 1.6)
    way = np.r_[np.zeros(500), V, np.zeros(500), -V, np.zeros(500)]
    log = drive.run(speed_loop(way, drive.J, dt=drive.dt), len(way))
    theta = log["theta"]
    log["w"] = (theta - np.r_[np.full(10, theta[0]), theta[:-10]]) / (10 * drive.dt)
    return drive, lg.balance(log)


def test_the_torque_of_a_reversal_stays_and_shows_the_inertia(scan):
    drive, found = scan
    assert not left_out(found)
    J = found.parameters.get("J") or found.uncertain.get("J")
    assert J is None or J.may_be(drive.J)


def test_a_speed_that_keeps_its_last_value_is_left_out_to_the_end_of_the_log():
    """Pulses and coasts of J 0.005, Fc 0.4, Fv 0.01; below 2 rad/s the speed is not renewed."""
    t, dt = 4e-3 * np.arange(6000), 4e-3
    u = np.select([t % 8 < 2, (t % 8 >= 4) & (t % 8 < 6)], [0.55, -0.58], 0.0)
    w = np.zeros(len(t))
    for k in range(len(t) - 1):
        v, fine = w[k], dt / 40
        for _ in range(40):
            rests = v == 0 and abs(u[k]) < 0.4
            a = 0.0 if rests else (u[k] - 0.4 * np.sign(v or u[k]) - 0.01 * v) / 0.005
            v = 0.0 if v * (v + fine * a) < 0 else v + fine * a
        w[k + 1] = v
    kept = w.copy()
    for k in range(1, len(t)):
        kept[k] = w[k] if abs(w[k]) > 2 else kept[k - 1]
    found = lg.balance({"t": t, "u": u, "w": np.round(kept, 5)})
    for key, value in (("J", 0.005), ("Fc", 0.4), ("Fv", 0.01)):
        assert found.parameters[key].value == pytest.approx(value, rel=0.02)
