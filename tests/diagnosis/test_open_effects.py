"""A declared effect whose values are left open is identified, whichever it is."""

import numpy as np
import pytest

from lugrectl import Model, diagnose, identify
from lugrectl.blocks.effects import held_lagging, held_late

from ..cases.balance_drive import J, simulate
from ..cases.drives import EFFECTS

DT = 4e-3
LATE = 6e-3
t = np.arange(0.0, 4.0, DT)
u = 0.45 * np.sin(4.4 * t) + 0.35 * np.sin(14.5 * t + 1.0) + 0.25 * np.sin(32.0 * t + 2.0)


def log(acts):
    theta, _ = simulate(acts, DT)
    return {"t": t, "u": u, "theta": theta + np.random.default_rng(0).normal(0, 2e-5, len(t))}


def opened(name):
    return Model.of(J=J, friction="coulomb").with_effect(name, {})


@pytest.mark.parametrize("name", EFFECTS)
def test_nothing_is_hidden(name):
    """What is declared in vain hardly moves the rest, and is within its bounds."""
    found = identify(log(u), opened(name))
    own = found.model.declarations()
    assert all(own[k].low <= v <= own[k].high for k, v in found.model.known().items())
    assert found.estimates["J"].value == pytest.approx(J, rel=0.02)


@pytest.mark.parametrize("answer", [identify, diagnose])
@pytest.mark.parametrize(
    "name, acting", [("input_delay", held_late), ("actuator_lag", held_lagging)]
)
def test_a_late_torque(name, acting, answer):
    found = answer(log(acting(u, DT, LATE)), opened(name))
    (late,) = [e.value for k, e in found.estimates.items() if k.startswith(name)]
    assert late == pytest.approx(LATE, rel=0.05)
