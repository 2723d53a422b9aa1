"""Cogging beside an offset, the commonest pair there is: both are named, and nothing else is.

Only rows near rest tell the offset from an asymmetry of friction."""

import math

import numpy as np
import pytest

import lugrectl as lg

J, FC, FV, RIPPLE, ORDER, PHASE, OFFSET = 0.002, 0.12, 0.02, 0.05, 12, 0.4, 0.06


@pytest.fixture(scope="module")
def found() -> lg.Diagnosis:
    return lg.diagnose(log(), lg.Model.of(J=J, friction="lugre"))


def log(seconds: float = 14.0, dt: float = 1e-3, inner: int = 20) -> dict[str, np.ndarray]:
    """A speed loop whose torque is held; Coulomb friction that sticks at rest."""
    rng, h = np.random.default_rng(4), dt / inner
    theta, w, rows = 0.0, 0.0, []
    for t in (dt * np.arange(round(seconds / dt))).tolist():
        goal = 6.0 * math.sin(1.3 * t) + 3.0 * math.sin(3.7 * t + 1.0)
        u = 0.1 * (goal - w) + 0.1 * math.tanh(3.0 * goal)
        rows.append((t, u, theta))
        for _ in range(inner):
            load = RIPPLE * math.sin(ORDER * theta + PHASE) + OFFSET
            pushed = w + h / J * (u - FV * w - load)
            w = math.copysign(max(abs(pushed) - h * FC / J, 0.0), pushed)
            theta += h * w
    t, u, theta = np.array(rows).T
    count = 2 * np.pi / 40_000
    return {
        "t": t,
        "u": u + rng.normal(0.0, 1e-3, len(u)),
        "theta": count * np.round(theta / count),
    }


SAME = {"constant_torque", "coulomb_asymmetry"}  # where rows near rest do not tell


def test_both_are_named(found) -> None:
    assert found.verdict in ("found", "ambiguous")
    names = {e.name for e in found.effects}
    alternatives = {a.name for e in found.effects for a in e.alternatives}
    assert "torque_ripple" in names and len(names) == 2
    assert "constant_torque" in names | alternatives and names | alternatives <= {*names, *SAME}


def test_their_values_are_right(found) -> None:
    values = {e.name: e.parameters for e in found.effects}
    assert values["torque_ripple"]["harmonic"].value == ORDER
    assert values["torque_ripple"]["amplitude"].value == pytest.approx(RIPPLE, rel=0.05)
    if "constant_torque" in values:
        offset = values["constant_torque"]["torque"].value
    else:  # of Fc, to one side
        offset = values["coulomb_asymmetry"]["ratio"].value * found.estimates["Fc"].value
    assert offset == pytest.approx(OFFSET, rel=0.05)
