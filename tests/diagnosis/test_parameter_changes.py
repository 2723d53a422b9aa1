"""What is said of fitted values that are far from the declared ones."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.display import with_interval

from ..cases import small_answers
from ..cases.balance_drive import log_of, simulate, torque
from ..cases.small_answers import FC, FV, J

LOG = small_answers.log()


def said(log=LOG, **values) -> str:
    """What is said of the declared values that a fit left."""
    found = lg.identify(log, lg.Model.of(friction="coulomb", **values))
    return " ".join(m for m in found.messages if "declared" in m)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.5, 0.7, 1.03])
def test_a_value_left_beyond_its_interval_is_said_with_both_values(factor):
    sentence = said(J=J / factor)
    assert "J is 0.00" in sentence and f"declared {J / factor:.6g} kg m2" in sentence
    assert "Fc is" not in sentence


@pytest.mark.slow
def test_what_the_interval_contains_or_the_model_holds_is_not_said():
    assert said(J=1.0001 * J, Fc=1.0001 * FC) == ""
    assert "beyond their" not in said(J={"value": 1.03 * J, "fixed": True})


@pytest.mark.slow
def test_an_angle_that_is_a_full_turn_away_is_the_same():
    heavy = small_answers.log(load=lambda theta, w: 0.2 * np.sin(theta - np.pi + 1e-3))
    gravity = {"name": "gravity", "amplitude": 0.2, "phase": np.pi - 1e-3}
    assert "gravity.phase" not in said(heavy, effects=gravity)


@pytest.mark.slow
def test_a_common_factor_is_the_torques_scale():
    told = said(J=J / 1.4, Fc=FC / 1.4, Fv=FV / 1.4)
    assert "factor 1.4" in told and "scale of u is wrong" in told
    assert "scale of u is wrong" not in said(J=J / 1.4, Fc=FC / 1.4, Fv=FV / 0.7)


@pytest.mark.slow
def test_a_note_on_moved_values_says_the_values_of_the_table():
    """Where torques come at odd instants, the table has the values of the robust balance."""
    dt = 2e-3
    u = torque(10.0, dt, seed=3)
    bursts = np.zeros(len(u))
    for start in (700, 1900, 2600, 4100):
        bursts[start : start + 25] = 0.5
    theta, _ = simulate(u - bursts, dt)
    theta = theta + np.random.default_rng(0).normal(0.0, 1e-4, len(u))
    found = lg.diagnose(log_of(u, dt, theta), lg.Model.of(J=0.006, Fc=0.08, Fv=0.006))
    notes = " ".join(found.messages)
    for key in ("J", "Fc"):
        shown, interval = with_interval(found.estimates[key])
        assert f"{key} is {shown} [{interval.replace(' to ', ', ')}]" in notes
