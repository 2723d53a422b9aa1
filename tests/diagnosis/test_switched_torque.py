"""A torque that is switched at irregular times has no beat, and is answered."""

import numpy as np
import pytest

import lugrectl as lg

CART = {"motion": "linear", "friction": "coulomb"}
DT = 1 / 150
SWITCHES = {
    "relay": [33, 33, 26, 18, 18, 18, 18, 12, 18, 18, 18, 41, 33, 26, 18, 26, 18, 18, 18, 18],
    "bang-bang": [30, 18, 18, *np.random.default_rng(3).integers(26, 45, 58).tolist()],
}


def switched(rows, size, J, Fc, Fv, seed=0):
    """A cart under a force that changes its sign after each of so many rows."""
    u = size * np.repeat((-1.0) ** np.arange(len(rows) + 1), [*rows, 40])
    v, x = np.zeros(len(u)), np.zeros(len(u))
    for i in range(1, len(u)):
        friction = Fv * v[i - 1] + Fc * np.sign(v[i - 1] or u[i - 1])
        v[i] = v[i - 1] + DT * (u[i - 1] - friction) / J
        x[i] = x[i - 1] + 0.5 * DT * (v[i] + v[i - 1])
    x += np.random.default_rng(seed).normal(0.0, 1e-5, len(x))
    return {"t": DT * np.arange(len(u)), "u": u, "theta": x}


@pytest.mark.parametrize("drive", SWITCHES)
def test_a_torque_that_is_switched_at_irregular_times_is_answered(drive):
    found = lg.diagnose(switched(SWITCHES[drive], 10.0, 6.5, 1.5, 3.0), CART)
    assert found.verdict == "adequate"
    assert found.model.J == pytest.approx(6.5, rel=0.02)
    assert found.model.friction.values["Fc"] == pytest.approx(1.5, rel=0.1)
    assert not [m for m in found.messages if "renewed only every" in m]
