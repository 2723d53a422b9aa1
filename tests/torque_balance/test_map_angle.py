"""Runs over parts of a turn: a torque of the angle beside friction."""

import numpy as np
import pytest

import lugrectl as lg

FC, FV = 12.6, 3.0
COULOMB = lg.Model.of(friction="coulomb")


def arm(torque, *, top=0.8, start=0.1, seed=0):
    """Runs of 3 s out of one place: a faster one is over larger angles."""
    chance, t = np.random.default_rng(seed), np.arange(0.0, 3.0, 0.01)
    made = []
    for w in np.outer(np.geomspace(0.03, 1.0, 7) * top, [1.0, -1.0]).ravel():
        theta = start * np.sign(w) + w * t
        u = FC * np.sign(w) + FV * w + torque(theta) + 0.3 * chance.standard_normal(len(t))
        made.append(lg.Record(t=t, u=u, theta=theta, motion="rotary"))
    return made


def within(estimate, true):
    low, high = estimate.ci95
    assert abs(true - 0.5 * (low + high)) < high - low


@pytest.mark.slow
def test_gravity_is_found_where_no_run_passes_a_turn():
    size, phase = 3.0, -1.2
    found = lg.diagnose(arm(lambda theta: size * np.sin(theta + phase)), COULOMB)
    assert (found.verdict, [e.name for e in found.effects]) == ("found", ["gravity"])
    for key, true in (("gravity.amplitude", size), ("Fc", FC), ("Fv", FV)):
        within(found.estimates[key], true)
    turned = found.estimates["gravity.phase"].value - phase
    assert abs(np.sin(turned)) < 0.03 and np.cos(turned) > 0.0
    assert found.map is not None
    assert np.ptp(found.map.u - (FC * np.sign(found.map.w) + FV * found.map.w)) < 1.0


@pytest.mark.slow
def test_a_declared_torque_over_the_angle_is_fitted():
    model = COULOMB.with_effect("gravity", {"amplitude": 30.0, "phase": 0.0})
    found = lg.diagnose(arm(lambda theta: 25.0 * np.sin(theta + 0.4)), model)
    assert found.verdict == "adequate" and not found.effects
    for key, true in (("gravity.amplitude", 25.0), ("gravity.phase", 0.4), ("Fc", FC)):
        within(found.estimates[key], true)


@pytest.mark.slow
def test_a_declared_effect_that_no_map_shows_is_not_found():
    known = {"name": "periodic_disturbance", "amplitude": 0.5, "frequency": 3.0, "phase": 0.0}
    model = lg.Model.of(friction="coulomb", effects=[known])
    found = lg.diagnose(arm(lambda theta: 3.0 * np.sin(theta - 1.2)), model)
    assert [e.name for e in found.effects] == ["gravity"]
