"""A torque that acts late: its time comes out right, and what cannot be told apart is said."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import J, simulate, torque

DT, SECONDS, TAU = 2e-3, 14.0, 0.008
EMPTY = {"motion": "rotary", "friction": "lugre"}


def lagged(x, tau=TAU):
    """Means over each sample of y in tau y' + y = x, for an x that is held."""
    share, y, means = np.exp(-DT / tau), 0.0, np.empty(len(x))
    for i, goal in enumerate(x):
        means[i] = goal + (y - goal) * (1.0 - share) * tau / DT
        y = goal + share * (y - goal)
    return means


def fast():
    """A torque of which most accelerates."""
    t = np.arange(round(SECONDS / DT)) * DT
    return sum(0.5 * np.sin(2 * np.pi * f * t + f) for f in (1.1, 4.3, 7.7))


def log(late, u=None, noise=0.02, viscous=0.0, **columns):
    """u as asked for, and the motion that follows its late form; the angle only if asked for."""
    u = torque(SECONDS, DT, seed=3) if u is None else u
    theta, w = simulate(late(u), DT, load=lambda theta, w: viscous * w)
    rng = np.random.default_rng(5)
    step = 2 * np.pi / 65536
    made = {"w": w + noise * rng.standard_normal(len(w)), "theta": np.floor(theta / step) * step}
    return {"t": np.arange(len(u)) * DT, "u": u} | {k: made[k] for k in columns}


@pytest.fixture(scope="module")
def speed_alone():
    return lg.diagnose(log(lagged, w=True), EMPTY)


def test_without_an_angle_a_lag_may_be_that_of_the_speed(speed_alone):
    assert speed_alone.verdict == "ambiguous"
    (effect,) = speed_alone.effects
    assert effect.name == "actuator_lag"
    assert [a.name for a in effect.alternatives] == ["velocity_sensor_lag"]
    assert "position" in speed_alone.experiment  # the angle tells which


def test_with_an_angle_it_is_that_of_the_torque():
    found = lg.diagnose(log(lagged, theta=True), EMPTY)
    assert found.verdict == "found" and [e.name for e in found.effects] == ["actuator_lag"]
    assert found.effects[0].parameters["time_constant"].value == pytest.approx(TAU, rel=0.1)


@pytest.mark.parametrize("samples", [2, 4])
def test_a_delay_is_found_where_friction_hides_without_it(samples):
    """Beside an inertia that comes late the viscous torque looks negative, and stands at 0."""

    def later(u):
        return np.concatenate([np.zeros(samples), u[:-samples]])

    found = lg.diagnose(log(later, fast(), viscous=0.05, theta=True), EMPTY | {"J": J})
    assert found.verdict == "found" and [e.name for e in found.effects] == ["input_delay"]
    known = pytest.approx(samples * DT, abs=0.1 * DT)
    assert found.comparison.effects[0].values["delay"] == known
    assert found.effects[0].parameters["delay"].value == known
