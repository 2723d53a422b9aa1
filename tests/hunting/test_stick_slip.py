"""Stick-slip while moving: both speeds against eigenvalues by hand and a simulation of its own."""

from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pytest

import lugrectl as lg

from . import brute_force as brute

LAW = {"J": 1.0, "Fc": 1.0, "Fs": 1.5, "vs": 0.1, "Fv": 0.1}
BRISTLES = {"sigma0": 1e3, "sigma1": 30.0}
LOOPS = [  # gains, and what differs from LAW
    ({"kp": 3.0, "ki": 0.0, "kd": 0.4}, {}),
    ({"kp": 3.0, "ki": 0.4, "kd": 0.8}, {}),
    ({"kp": 900.0, "ki": 900.0, "kd": 3.0}, {"Fs": 1.2, "vs": 0.01}),
]


def loop(number, law="stribeck", **more):
    gains, changed = LOOPS[number]
    own = LAW | changed | more
    return lg.Model.of(friction=law, **own), gains, own | gains


@cache
def speeds(number, law="stribeck"):
    """What is found of a loop."""
    model, gains, _ = loop(number, law, **(BRISTLES if law == "lugre" else {}))
    return lg.stick_slip_speed(model, **gains)


def starts(own):
    """Errors of a stick without torque, rad."""
    return np.array([0.0, 1.0, 5.0]) * own["Fs"] / own["kp"]


@pytest.mark.slow
@pytest.mark.parametrize("number", range(3))
def test_below_speed_start_routh_does_not_hold(number):
    """(kd + dF/dw) kp = ki J at speed_start, with dF/dw by hand."""
    own, v = loop(number)[2], speeds(number).speed_start
    fall = 2.0 * (own["Fs"] - own["Fc"]) * v / own["vs"] ** 2 * np.exp(-((v / own["vs"]) ** 2))
    assert own["kd"] + own["Fv"] - fall == pytest.approx(own["ki"] / own["kp"], abs=1e-3 * fall)
    assert v > own["vs"] / np.sqrt(2.0)  # beyond the steepest fall: the higher of two such speeds


@pytest.mark.cases
@pytest.mark.parametrize("number", range(3))
def test_stick_slip_persists_just_below_speed_end_and_not_above(number):
    own, end = loop(number)[2], speeds(number).speed_end
    low, high = (
        max(brute.dragged(**own, v=f * end, e=e, periods=100, step=1e-3) for e in starts(own))
        for f in (0.97, 1.03)
    )
    assert low > 5 and high == 0


def test_stiff_bristles_hardly_change_the_speeds():
    soft, rigid = speeds(1, "lugre"), speeds(1)
    assert soft.speed_start == pytest.approx(rigid.speed_start, rel=0.02)
    assert soft.speed_end == pytest.approx(rigid.speed_end, rel=0.02)


def test_between_the_two_speeds_the_start_decides_or_it_swings():
    for found in (speeds(0), speeds(1)):
        assert found.speed_end > found.speed_start and "disturbance decides" in found.messages[0]
    less, gains = lg.Model.of(friction="stribeck", **LAW), {"kp": 3.0, "kd": 2.5}
    found = lg.stick_slip_speed(less, **gains)
    assert 0.0 < found.speed_end < found.speed_start and "swings" in found.messages[0]


def test_without_stiction_nothing_sticks():
    smooth = lg.Model.of(friction="coulomb", J=1.0, Fc=1.0, Fv=0.1)
    found = lg.stick_slip_speed(smooth, kp=3.0, ki=0.4, kd=0.8)
    assert found.speed_start == found.speed_end == 0.0
    assert repr(found).startswith("moving, the loop does not stick and slip")


def test_a_loop_that_grows_has_no_speed_above_which_it_slides():
    found = lg.stick_slip_speed(loop(0)[0], kp=3.0, ki=40.0, kd=0.4)
    assert found.speed_end == np.inf and "ki J" in found.messages[0]
    assert found.summary()["speed_end"] is None
    assert found.plot().get_title("left") == "The loop is unstable at each speed"
    plt.close("all")


def test_the_picture_marks_both_speeds_and_effects_are_named():
    model, gains, _ = loop(0)
    arm = lg.Model.of(model, effects={"name": "gravity", "amplitude": 0.1, "phase": 0.0})
    found = lg.stick_slip_speed(arm, **gains)
    assert found.messages[0] == "left out: gravity"
    marked = [line.get_xdata()[0] for line in found.plot().lines]
    assert found.speed_start in marked and found.speed_end in marked
    plt.close("all")
    with pytest.raises(lg.InputError, match="no gain 'Fc'"):
        lg.stick_slip_speed(model, **gains, vary={"Fc": (1.0, 2.0)})


@pytest.mark.slow
def test_a_narrow_band_of_speeds_that_stick_is_found():
    """Simulated elsewhere in steps of 4e-6 s, it sticks at 0.095 rad/s up to kd 9.27."""
    law = {"J": 0.6, "Fc": 0.65, "Fs": 2.85, "vs": 0.16, "Fv": 0.1}
    found = lg.stick_slip_speed(lg.Model.of(friction="stribeck", **law), kp=95.0, kd=9.2)
    assert 0.095 < found.speed_end < 0.12
