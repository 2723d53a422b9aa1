"""A torque that acts late: its time comes out right, and what cannot be told apart is said."""

import math

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import log_of, simulate, torque

DT, SECONDS, TAU = 2e-3, 9.0, 0.008
EMPTY = {"motion": "rotary", "friction": "coulomb"}


def lagged(x, tau=TAU):
    """Means over each sample of y in tau y' + y = x, for an x that is held."""
    share, y, means = np.exp(-DT / tau), 0.0, np.empty(len(x))
    for i, goal in enumerate(x):
        means[i] = goal + (y - goal) * (1.0 - share) * tau / DT
        y = goal + share * (y - goal)
    return means


def log():
    """u as asked for, and the speed that follows its late form."""
    u = torque(SECONDS, DT, seed=3)
    _, w = simulate(lagged(u), DT)
    return log_of(u, DT, w=w + 0.02 * np.random.default_rng(5).standard_normal(len(w)))


def test_a_lag_of_the_torque_is_told_from_one_of_the_speed():
    """Friction near rest is not late: the finer fit shows which of the two it is."""
    found = lg.diagnose(log(), EMPTY)
    assert found.verdict == "found" and [e.name for e in found.effects] == ["actuator_lag"]
    assert found.effects[0].parameters["time_constant"].value == pytest.approx(TAU, rel=0.01)


def screw(mass=340.0, viscous=1700.0, coulomb=120.0, late=1.1e-3, dt=2.5e-4, seconds=3.0, fine=10):
    """A screw drive that a chirp of force up to 14 Hz moves, the force late; at 4 kHz."""
    h, n = dt / fine, round(seconds / dt)
    t = np.arange(n) * dt
    u = 900 * np.sin(2 * np.pi * (0.5 * t + 13.5 * t**2 / (2 * seconds)))
    u += 200 * np.sin(2 * np.pi * 0.7 * t)
    force = np.r_[np.zeros(round(late / h)), np.repeat(u, fine)]
    w, x, places = 0.0, 0.0, np.empty(n)
    for k in range(n):
        places[k] = x
        for i in range(k * fine, (k + 1) * fine):
            w += h / mass * (force[i] - viscous * w - coulomb * math.tanh(w / 1e-3))
            x += h * w
    return {"t": t, "u": u, "theta": np.round(places / 1e-7) * 1e-7}


@pytest.mark.slow
@pytest.mark.sample
def test_a_delay_is_found_where_friction_hides_without_it():
    """Beside an inertia that comes late the viscous force looks smaller: with that, a lag of the
    same time explained as much as the delay."""
    found = lg.diagnose(screw(), {"motion": "linear", "friction": "coulomb"})
    assert found.verdict == "found" and [e.name for e in found.effects] == ["input_delay"]
    assert found.effects[0].parameters["delay"].value == pytest.approx(1.1e-3, abs=5e-5)
