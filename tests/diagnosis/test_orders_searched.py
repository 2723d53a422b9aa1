"""The orders of an effect that are searched: of an inertia, however small the travel."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.sines import sines

J, FC, FV, RATIO, PHASE = 1.7, 10.0, 4.2, 0.25, 0.6  # kg m2, N m, N m s/rad, 1, rad


def test_an_inertia_once_per_turn_is_found_over_a_third_of_a_turn():
    """An arm that swings by 1.1 rad to either side; order 2 explains most of it, too."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 15.0, 1e-3)
    theta, w, a = sines(t, ((0.5, 0.9, 0.0), (0.35, 0.53, 1.0), (0.3, 0.31, 2.0)))
    inertia = J * (1.0 + RATIO * np.sin(theta + PHASE))
    slope = J * RATIO * np.cos(theta + PHASE)
    u = inertia * a + 0.5 * slope * w**2 + FC * np.sign(w) + FV * w
    noisy = {"u": u + 0.02 * rng.standard_normal(len(t))}
    noisy |= {"theta": theta + 2e-5 * rng.standard_normal(len(t))}
    found = lg.diagnose({"t": t, **noisy}, lg.Model.of(friction="coulomb"))
    assert [e.name for e in found.effects] == ["pose_dependent_inertia"]
    values = {k: e.value for k, e in found.effects[0].parameters.items()}
    assert values["harmonic"] == 1.0 and values["ratio"] == pytest.approx(RATIO, rel=0.03)
    assert found.model.values()["J"] == pytest.approx(J, rel=0.02)
