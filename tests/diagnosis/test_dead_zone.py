"""A dead zone of the actuator, which looks like more inertia and a late torque."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.sines import sines

J, FC, FV, HALF = 3.4e-4, 0.13, 6.5e-4, 0.026  # kg m2, N m, N m s/rad, N m


def log(half):
    """A screw on three sines, behind a dead zone: what its motion needs, and half of it more."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 12.0, 1e-3)
    theta, w, a = sines(t, ((6.0, 1.9, 0.0), (9.0, 0.7, 1.0), (16.0, 0.31, 2.0)))
    torque = J * a + FC * np.sign(w) + FV * w
    u = torque + half * np.sign(torque) + 1e-4 * rng.standard_normal(len(t))
    return {"t": t, "u": u, "theta": theta + 2e-4 * rng.standard_normal(len(t))}


def test_nothing_is_named_without_it():
    assert lg.diagnose(log(0.0), lg.Model.of(friction="coulomb")).verdict == "adequate"


def test_a_dead_zone_is_named():
    found = lg.diagnose(log(HALF), lg.Model.of(friction="coulomb"))
    assert [e.name for e in found.effects] == ["actuator_dead_zone"]
    half, values = found.effects[0].parameters["half_width"], found.model.values()
    assert half.may_be(HALF) and np.diff(half.ci95) < 0.15 * HALF
    assert values["J"] == pytest.approx(J, rel=0.01) and values["Fc"] == pytest.approx(FC, rel=0.01)
    assert not any("column lags" in message for message in found.messages)
