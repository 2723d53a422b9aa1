"""Step responses: one torque in each run, as of a motor that is switched on."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

J, FC, FV, DT, COUNT = 0.65, 9.0, 8.0, 5e-3, np.deg2rad(1.0)
MODEL = lg.Model.of(friction="coulomb")


def switched(torques):
    """The log of an encoder of 360 counts a turn, from rest, with the torque of each sample."""
    parts = 10
    h, w, angle, theta = DT / parts, 0.0, 0.0, []
    for u in torques:
        theta.append(angle)
        for _ in range(parts):
            drive = u - FV * w
            if w == 0 and abs(drive) <= FC:
                continue
            way = np.sign(w) if w else np.sign(drive)
            moved = w + (drive - FC * way) / J * h
            w = 0.0 if w * moved < 0 else moved
            angle += w * h
    t = DT * np.arange(len(torques))
    return {
        "t": t,
        "u": np.asarray(torques, float),
        "theta": np.round(np.array(theta) / COUNT) * COUNT,
    }


def held(torque, rest=0):
    return switched(np.r_[np.zeros(rest), np.full(300, float(torque))])


def test_a_torque_that_changes_at_speed_does():
    """Switched off at speed the drive coasts: two torques in one direction."""
    found = lg.balance(switched(np.r_[np.zeros(100), np.full(300, 40.0), np.zeros(100)]))
    low, high = found.parameters["J"].ci95
    assert low < J < high


def test_one_constant_torque_is_refused_with_what_it_may_be():
    found = lg.diagnose(held(40.0), MODEL)
    assert found.verdict == "refused"
    assert "dead torque channel" in found.reason and "one torque throughout" in found.reason
    with pytest.raises(lg.Refused, match="constant"):
        lg.read_record(held(40.0))


def test_a_step_whose_rise_the_log_does_not_show_is_a_point_of_the_friction_curve():
    """Without a rise nothing contradicts it: friction at that speed is certain."""
    t = DT * np.arange(400)
    on = t >= 0.5
    theta = np.round(np.maximum(t - 0.5, 0.0) * 30.0 / COUNT) * COUNT
    found = lg.balance({"t": t, "u": 0.25 * on, "theta": theta})
    assert found.combinations or found.parameters
    assert not any("any inertia" in said for said in found.said)
