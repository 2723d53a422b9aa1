"""Observers side by side: the terms are equal, and the figures are those of the scenarios."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import members

from ..cases.observed import P, believing, longer

FAST = ("velocity", "noise")


@pytest.fixture(scope="module")
def found():
    return lg.compare_observers(P, ["natural", "existing"], scenarios=FAST)


@pytest.mark.slow
def test_at_equal_feedback_the_natural_observer_is_better(found):
    """Its PI has what k adds: kp + sigma1 k, ki + sigma0 k; without that the existing one seems
    better, and its own error is the same."""
    alone = lg.compare_observers(P, found.names, scenarios=["velocity"], equal=False)
    errors = [one[name].velocity for one in (found, alone) for name in ("natural", "existing")]
    assert errors == pytest.approx([0.0049, 0.0165, 0.0313, 0.0165], abs=1e-4)
    gains = found["natural"].feedback
    assert gains["velocity.kp"] == pytest.approx(1.6 + 0.6 * 0.35)
    assert gains["velocity.ki"] == pytest.approx(0.16 + 260 * 0.35)
    assert found["existing"].feedback["velocity.ki"] == 0.16


def test_a_good_figure_may_depend_on_one_parameter():
    """The temperature observer takes sigma0 for known; the disturbance observer has only J."""
    names = ["temperature", "disturbance"]
    found = lg.compare_observers(P, names, scenarios=["velocity", "parameters"])
    assert found["temperature"].weakest == "sigma0 x0.8"
    assert found["temperature"].parameters > 10 * found["temperature"].velocity
    assert found["disturbance"].weakest.startswith("J x")
    assert found["disturbance"].parameters == pytest.approx(found["disturbance"].velocity, rel=0.01)


@longer
def test_a_loop_bears_the_dead_time_that_its_bandwidth_allows():
    """With k = 0 nothing is added: the crossover kp/J leaves pi/2/(kp/J) = 2.2 ms."""
    found = lg.compare_observers(P, ["proposed"], scenarios=["delay"], equal=False)
    assert 0.5e-3 < found["proposed"].delay < 3e-3


def test_none_is_the_loop_without_an_observer_and_a_name_may_stand_alone():
    bare = lg.compare_observers(P, [None], scenarios="velocity")
    same = lg.compare_observers(P, "no", scenarios=["velocity"])
    assert bare.names == same.names == ("no_observer",)
    assert bare["no_observer"].velocity == same["no_observer"].velocity > 0.02


@pytest.fixture(scope="module")
def sampled():
    names = ["natural", "disturbance"]
    return lg.compare_observers(
        P, names, scenarios=["load", "rate", "rounding"], rates=[250, 1000], load=0.2
    )


def test_a_load_step_harms_less_where_the_observer_takes_it_for_friction(sampled):
    calm = lg.compare_observers(P, sampled.names, scenarios="load", load=0.0)
    grown = [sampled[k].load - calm[k].load for k in sampled.names]
    assert grown[0] > 2.0 * grown[1] > 0.0


def test_a_loop_bears_the_rate_that_its_bandwidth_allows(sampled):
    """kp/J is 823 1/s: a torque held for 4 ms is more than pi/2 late there."""
    for row in sampled:
        assert row.rate == 1000.0 and set(row.sampled) == {"1000", "250"}
        assert row.sampled["1000"] < 0.01 < row.sampled["250"]


def test_a_coarser_encoder_inside_the_loop_makes_a_larger_error(sampled):
    finer = lg.compare_observers(P, "natural", scenarios="rounding", resolution=1e-8)["natural"]
    assert sampled.terms["rounding"] == pytest.approx(2 * np.pi / 131072)
    assert sampled["natural"].rounding > 2.0 * finer.rounding
    assert finer.rounding == pytest.approx(sampled["natural"].sampled["1000"], rel=0.1)


def test_the_answer_has_the_forms_of_every_list(found):
    said = str(found)
    assert said.splitlines()[1].split()[0] == "observer" and "natural" in said
    assert "delay" not in said and "<table" in found._repr_html_()
    made = json.loads(found.to_json())
    assert made["terms"]["wrong"] == 0.8 and made["observers"][1]["name"] == "existing"
    assert found.to_frame().loc["natural", "velocity"] == found["natural"].velocity


def test_each_scenario_of_each_observer_is_reported_as_it_begins():
    said = []
    scenarios = ["velocity", "rounding", "load"]
    lg.compare_observers(P, ["disturbance", None], scenarios=scenarios,
                         progress=lambda part, what: said.append((part, what)))  # fmt: skip
    shares = [part for part, _ in said]
    assert shares == pytest.approx([k / 6 for k in range(6)])
    assert said[2][1] == "simulating disturbance_observer, scenario rounding"


# ---- a drive with another law ---------------------------------------------------------


def test_a_law_of_ones_own_is_the_plant_and_observers_that_copy_lugre_are_left_out(smooth):
    drive = lg.Model.of(J=0.002, friction=smooth, Fc=0.25)
    found = lg.compare_observers(drive, ["natural", "disturbance", None], scenarios="velocity")
    assert found.names == ("disturbance", "no_observer")
    assert found["disturbance"].velocity < 0.5 * found["no_observer"].velocity
    why = "it must know sigma0, sigma1, Fs, vs, which the model with smooth_coulomb friction"
    assert list(found.refused) == ["natural"] and found.refused["natural"].startswith(why)
    assert f"natural left out: {why}" in repr(found)
    assert f"natural left out: {why}" in found._repr_html_()
    assert json.loads(found.to_json())["refused"] == found.refused


def test_where_no_observer_is_left_one_sentence_says_why(smooth):
    with pytest.raises(lg.InputError, match="natural_observer cannot be compared: it must know"):
        lg.compare_observers(lg.Model.of(J=0.002, friction=smooth), "natural")


def test_a_load_is_asked_for_where_the_law_has_no_coulomb_friction():
    drive = lg.Model.of(J=0.002, friction="viscous", Fv=0.02)
    with pytest.raises(lg.InputError, match="load is missing: half of Fc is its default"):
        lg.compare_observers(drive, "disturbance", scenarios="load")
    found = lg.compare_observers(drive, "disturbance", scenarios="load", load=0.1)
    assert found["disturbance"].load < 0.1


# ---- every observer in the same loops -------------------------------------------------

NAMES = [k.removesuffix("_observer") for k in members("observer") if k != "no_observer"]


@longer
@pytest.mark.parametrize("name", NAMES)
def test_every_observer_compensates(name):
    """The velocity loop of compensate, friction 20 % low "before" and exact "after"."""
    found = lg.compensate(P, declared=believing(0.8), observer=name, kp=0.5, ki=2.0)
    assert found.after < 0.35 * found.none
    assert not found.messages or found.after <= 1.05 * found.before


@longer
def test_a_position_observer_starts_where_the_drive_stands():
    t = np.arange(0.0, 2.0, 1e-3)
    r = 0.5 * np.sin(2.0 * t) ** 2
    for name in ("position_coulomb", "position_lugre"):
        near, far = (
            lg.compensate(P, loop="position", observer=name, reference=(t, r + at)).runs["after"]
            for at in (0.0, 3.0)
        )
        assert far.y - 3.0 == pytest.approx(near.y, abs=1e-5)
