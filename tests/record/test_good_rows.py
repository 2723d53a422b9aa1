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
