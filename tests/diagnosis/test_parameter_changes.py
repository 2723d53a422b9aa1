"""What is said of fitted values that are far from the declared ones."""

import numpy as np
import pytest

from lugrectl import Model, diagnose
from lugrectl.blocks.model import model_from_dict
from lugrectl.core.display import with_interval
from lugrectl.diagnosis.notes import moved
from lugrectl.estimates.findings import Estimate

from ..cases.balance_drive import simulate, torque

DECLARED = {"J": 0.1, "Fc": 1.0, "Fs": 1.5, "Fv": 0.2}


def model() -> Model:
    friction = {"model": "lugre", "sigma0": 100.0, "sigma1": 1.0, "vs": 0.01}
    friction |= {k: v for k, v in DECLARED.items() if k != "J"}
    plant = {"J": DECLARED["J"]}
    return model_from_dict({"motion": "rotary", "plant": plant, "friction": friction}, "m")


def said(half: float = 0.01, **factors: float) -> str:
    """What is said where these values came out by a factor, each within ``half`` of itself."""
    values = model().values() | {k: DECLARED[k] * r for k, r in factors.items()}
    ends = {k: (v * (1 - half), v * (1 + half)) for k, v in values.items()}
    found = {k: Estimate(v, "", ends[k]) for k, v in values.items()}
    return " ".join(moved(found, model()))


@pytest.mark.parametrize("factor", [1.5, 0.7, 1.03])
def test_a_value_left_beyond_its_interval_is_said_with_both_values(factor):
    sentence = said(J=factor)
    assert f"J is {0.1 * factor:.3f}"[:9] in sentence and "declared 0.1 kg m2" in sentence
    assert sentence.count("declared") == 2 and sentence.endswith(".")


def test_what_the_interval_contains_or_the_model_holds_is_not_said():
    assert said(half=0.4, Fc=1.3) == ""
    found = {"J": Estimate(0.2, "kg m2", (0.19, 0.21))}
    assert "J is 0.2" in moved(found, model())[0] and moved(found, model().fix("J")) == []


def test_an_angle_that_is_a_full_turn_away_is_the_same():
    whole = model().with_effect("gravity", {"amplitude": 0.2, "phase": 3.1})
    found = {"gravity.phase": Estimate(-3.2, "rad", (-3.25, -3.1))}
    assert moved(found, whole) == []


def test_a_higher_level_may_be_a_dead_zone():
    assert "dead zone" in said(Fc=1.3, Fs=1.2)
    assert "dead zone" not in said(Fc=0.7)


def test_a_common_factor_is_the_torques_scale():
    told = said(J=1.4, Fc=1.41, Fv=1.39, Fs=1.4)
    assert "factor 1.4" in told and "scale of u is wrong" in told and "dead zone" not in told
    assert "scale of u is wrong" not in said(J=1.4, Fc=1.41, Fv=0.7)


def test_a_note_on_moved_values_says_the_values_of_the_table():
    """Where torques come at odd instants, the table has the values of the robust balance."""
    dt = 2e-3
    u = torque(10.0, dt, seed=3)
    bursts = np.zeros(len(u))
    for start in (700, 1900, 2600, 4100):
        bursts[start : start + 25] = 0.5
    theta, _ = simulate(u - bursts, dt)
    theta = theta + np.random.default_rng(0).normal(0.0, 1e-4, len(u))
    declared = Model.of(J=0.006, Fc=0.08, Fv=0.006)
    found = diagnose({"t": dt * np.arange(len(u)), "u": u, "theta": theta}, declared)
    notes = " ".join(found.messages)
    for key in ("J", "Fc"):
        shown, interval = with_interval(found.estimates[key])
        assert f"{key} is {shown} [{interval.replace(' to ', ', ')}]" in notes
