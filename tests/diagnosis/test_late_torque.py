"""A torque that acts late: its time comes out right, and what cannot be told apart is said."""

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


@pytest.mark.slow
def test_a_lag_of_the_torque_is_told_from_one_of_the_speed():
    """Friction near rest is not late: the finer fit shows which of the two it is."""
    found = lg.diagnose(log(), EMPTY)
    assert found.verdict == "found" and [e.name for e in found.effects] == ["actuator_lag"]
    assert found.effects[0].parameters["time_constant"].value == pytest.approx(TAU, rel=0.01)
