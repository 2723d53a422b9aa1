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


@pytest.mark.slow
@pytest.mark.parametrize("runs", [[held(40.0, 100)], [held(40.0, 100), held(-80.0, 100)]])
def test_one_torque_in_each_direction_does_not_tell_inertia_from_friction(runs):
    plain = lg.balance(runs)
    assert not plain.parameters and not plain.combinations
    assert "one value in each direction (40" in plain.said[-1] and "any inertia" in plain.said[-1]
    found = lg.diagnose(runs, MODEL)
    assert found.verdict == "refused" and "two or more torques" in found.experiment


@pytest.mark.slow
def test_what_the_steps_do_not_tell_has_no_value():
    """Exact motions from rest: no value has an interval of zero width."""
    J, Fc, Fv, dt, runs = 0.004, 0.12, 0.006, 2e-3, []
    for torque in (0.18, 0.26, 0.34):
        t = dt * np.arange(1500)
        s, tau = np.maximum(t - 0.2, 0.0), J / Fv
        theta = (torque - Fc) / Fv * (s - tau * (1.0 - np.exp(-s / tau)))
        count = 2.0 * np.pi / 16384
        log = {"t": t, "u": np.where(t < 0.2, 0.0, torque)}
        runs.append(log | {"theta": np.floor(theta / count) * count})
    found = lg.identify(runs, MODEL)
    for key, true in (("J", J), ("Fc", Fc), ("Fv", Fv)):
        own = found.estimates.get(key)
        assert own is None or own.ci95 is None or own.may_be(true)
    ends = [e.ci95 for e in (*found.estimates.values(), *found.plain.parameters.values()) if e.ci95]
    assert all(high > low for low, high in ends)
    (test,) = (one for one in found.plain.bench_tests if one.kind == "steps_and_pulses")
    assert test.values["J"].value == pytest.approx(J, rel=0.03)


def test_a_torque_that_is_switched_at_irregular_times_is_answered():
    """A cart under a force that changes its sign after each of so many rows: it has no beat."""
    J, Fc, dt = 6.5, 1.5, 1 / 150
    rows = [33, 33, 26, 18, 18, 18, 18, 12, 18, 18, 18, 41, 33, 26, 18, 26, 18, 18, 18, 18]
    u = 10.0 * np.repeat((-1.0) ** np.arange(len(rows) + 1), [*rows, 40])
    v, x = np.zeros(len(u)), np.zeros(len(u))
    for i in range(1, len(u)):
        friction = 3.0 * v[i - 1] + Fc * np.sign(v[i - 1] or u[i - 1])
        v[i] = v[i - 1] + dt * (u[i - 1] - friction) / J
        x[i] = x[i - 1] + 0.5 * dt * (v[i] + v[i - 1])
    x += np.random.default_rng(0).normal(0.0, 1e-5, len(x))
    log = {"t": dt * np.arange(len(u)), "u": u, "theta": x}
    found = lg.diagnose(log, {"motion": "linear", "friction": "coulomb"})
    assert found.verdict == "adequate"
    assert found.model.J == pytest.approx(J, rel=0.02)
    assert found.model.friction.values["Fc"] == pytest.approx(Fc, rel=0.1)
    assert not [m for m in found.messages if "renewed only every" in m]
