"""Torque steps in one direction, a run each: no value has an interval of zero width."""

import numpy as np
import pytest

import lugrectl as lg

J, FC, FV, DT = 0.004, 0.12, 0.006, 1e-3


def step(torque, seconds=3.0):
    """A rest, then one torque: the exact motion, as encoder counts."""
    t = DT * np.arange(round(seconds / DT))
    s = np.maximum(t - 0.2, 0.0)
    top, tau = (torque - FC) / FV, J / FV
    theta = top * (s - tau * (1.0 - np.exp(-s / tau)))
    count = 2.0 * np.pi / 16384
    return {"t": t, "u": np.where(t < 0.2, 0.0, torque), "theta": np.floor(theta / count) * count}


def test_what_the_steps_do_not_tell_has_no_value():
    found = lg.identify([step(x) for x in (0.18, 0.26, 0.34)], lg.Model.of(friction="coulomb"))
    for key, true in (("J", J), ("Fc", FC), ("Fv", FV)):
        own = found.estimates.get(key)
        assert own is None or own.ci95 is None or own.may_be(true)
    ends = [e.ci95 for e in (*found.estimates.values(), *found.plain.parameters.values()) if e.ci95]
    assert all(high > low for low, high in ends)
    (test,) = (one for one in found.plain.bench_tests if one.kind == "steps_and_pulses")
    assert test.values["J"].value == pytest.approx(J, rel=0.03)
