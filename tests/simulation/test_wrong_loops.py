"""Loops that are wired wrongly say so: by an error, or by a warning that names what to change."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import Diverged

from ..cases.own import moving, static

P, DT = lg.table1(), 1e-3
T = np.arange(0, 0.3, DT)
WRONG = pytest.mark.filterwarnings("ignore:.*has the wrong sign:RuntimeWarning")


def textbook():
    """e = reference - measured, the sign of every textbook and not of this package."""
    return static(lambda t, x, u, p: u[0] - u[1], ["r", "w"], ["e"], "compare")


def parts(pi=None, error=None):
    return [lg.plant(P), error or textbook(), pi or lg.pi(1.6, 0.16)]


def sampled_parts():
    return parts(lg.sampled(lg.pi(1.6, 0.16), DT))


def interconnected():
    return ct.interconnect(parts(), inputs=["r"], outputs=["w"], check_unused=False)


RUNS = {
    "list": lambda: lg.simulate(parts(), T, {"r": 0.1}),
    "interconnection": lambda: lg.simulate(interconnected(), T, 0.1),
    "LSODA": lambda: lg.simulate(parts(), T, {"r": 0.1}, method="LSODA"),
    "held": lambda: lg.simulate(parts(), T, {"r": 0.1}, method="LSODA", hold=True),
    "sampled": lambda: lg.simulate(sampled_parts(), T, {"r": 0.1}),
    "drive": lambda: lg.simulate_sampled(lg.plant(P), sampled_parts()[1:], T, {"r": 0.1}),
}


@WRONG
@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
def test_a_diverging_loop_is_an_error_with_state_and_time(run):
    """And hints at the sign of e."""
    match = r"state plant_w .* t = 0\.0\d|t = 0\.0\d.* state plant_w"
    with pytest.raises(Diverged, match=match) as said:
        run()
    assert "e = measured - reference" in str(said.value)


@pytest.mark.parametrize("samples", [200, 2000])
def test_a_diverging_discrete_system_is_an_error(samples):
    with pytest.raises(Diverged, match=r"state x\[0\].* t = "):
        lg.simulate(ct.tf([1], [1, -2], DT), DT * np.arange(samples), 1.0)


def test_large_numbers_alone_are_no_divergence():
    """A constant of 1e24 in the equations, and a lag that is driven by 1e20."""
    rate = moving(lambda t, x, u, p: 1e24 + 0 * x, 1, inputs=1)
    assert lg.simulate(rate, [0.0, 0.5, 1.0]).outputs[-1] == pytest.approx(1e24)
    lag = ct.tf([1], [1, 1])
    assert lg.simulate(lag, np.linspace(0, 9, 99), 1e20).outputs[-1] == pytest.approx(
        1e20, rel=1e-3
    )
    unstable = ct.tf([1], [1, -1])
    grown = lg.simulate(unstable, np.linspace(0, 20, 99), 1.0).outputs[-1]
    assert grown == pytest.approx(np.expm1(20.0), rel=1e-4)


@pytest.mark.parametrize(
    "made",
    [
        lambda: parts(),
        lambda: parts(error=lg.error(inputs=["w", "r"])),
        lambda: parts(lg.pi(-1.6, -0.16), lg.error()),
        lambda: sampled_parts(),
        lambda: interconnected(),
    ],
)
def test_a_feedback_of_the_wrong_sign_warns_and_names_the_controller(made):
    with pytest.warns(RuntimeWarning, match="feedback through pi has the wrong sign"):
        lg.simulate(made(), T[:10], {"r": 0.1})


@pytest.mark.slow
@pytest.mark.parametrize(
    "made",
    [
        lambda: parts(error=lg.error()),
        lambda: parts(lg.pi(-1.6, -0.16)),  # e and the gains turned: right again
        lambda: [*parts(error=lg.error()), lg.proposed_observer(P), lg.compensation()],
        lambda: [lg.plant(P), lg.error("position"), lg.pid(15.0, 1.55, 0.3)],
    ],
)
def test_a_feedback_of_the_right_sign_says_nothing(made):
    lg.simulate(made(), T[:10], {"r": 0.1})  # a warning is an error here


def test_a_sign_that_a_parameter_turns_is_seen_in_code_that_is_compiled():
    loop, turned = lg.velocity_loop(P), {"pi.kp": -1.6, "pi.ki": -0.16}
    for gains in ({}, {"pi.kp": 0.0, "pi.ki": 0.0}):
        lg.simulate(loop, T[:10], {"r": 0.1}, params=gains)
    with pytest.warns(RuntimeWarning, match="velocity_loop: the feedback through pi has the wrong"):
        lg.simulate(loop, T[:10], {"r": 0.1}, params=turned)


@pytest.mark.parametrize(
    "made, words",
    [
        (lambda: parts(lg.pi(outputs=["torque"])), "input u of plant.* torque of pi"),
        (lambda: parts(lg.pi(outputs=["u1"])), "input u of plant.* torque of pi|mean u1 of pi"),
        (
            lambda: parts(error=lg.error(inputs=["r", "w_m"])),
            "input w_m of error.* Nothing reads theta, w, F of plant",
        ),
    ],
)
def test_an_input_that_nothing_feeds_is_named_with_the_output_that_nothing_reads(made, words):
    with pytest.warns(RuntimeWarning, match=words):
        lg.simulate([*made()], T[:10], {"r": 0.1})


def test_the_same_holds_for_a_sampled_drive():
    """The controller reads a misnamed error; what puts it out is read by nothing."""
    controllers = [lg.pi(1.6, 0.16, inputs=["err"]), lg.pi(0.1, 0.0, name="pi2", inputs=["w"])]
    drive = [lg.error(), *(lg.sampled(one, DT) for one in controllers)]
    with pytest.warns(RuntimeWarning, match="input err of pi.*e of error"):
        lg.simulate_sampled(lg.plant(P), drive, T[:10], {"r": 0.1})


@pytest.mark.slow
def test_an_input_that_is_left_out_on_purpose_says_nothing():
    lg.simulate([lg.plant(P), lg.error(), lg.pi()], T[:10], {"r": 0.1})  # d
    lg.simulate([lg.plant(P), lg.proposed_observer(P)], T[:10], {"u": 0.0})
    lg.simulate([lg.proposed_observer(P), lg.prefilter()], T[:10], {"w": 0.0, "u": 0.0})
    lg.simulate([lg.plant(P), lg.pi(outputs=["torque"])], T[:10], {"u": 0.0, "e": 0.0})


def test_the_name_of_a_held_input_changes_nothing():
    """A drive holds its torque, whatever the torque of a sampled observer is called."""
    t = DT * np.arange(60)
    w, u = 0.1 * np.sin(20 * t), 0.3 * np.sign(np.sin(50 * t))
    own = lg.simulate(lg.sampled(lg.disturbance_observer(P), DT), t, {"w": w, "u": u}).outputs[0]
    other = lg.sampled(lg.disturbance_observer(P, inputs=["w_m", "uc"]), DT)
    assert np.array_equal(own, lg.simulate(other, t, {"w_m": w, "uc": u}).outputs[0])
