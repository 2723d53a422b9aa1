"""A loop of blocks is linearized around its dead times, which stay exact."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import InputError

W = np.array([0.3, 20.0, 400.0, 3000.0])
S = 1j * W
VISCOUS = lg.Model.of(J=0.0022, friction="viscous", Fv=0.018)


def late_model(delay):
    return lg.Model.of(VISCOUS, effects=[{"name": "input_delay", "delay": delay}])


def cascade(late):
    """theta/r of a cascade with kv = 20, PI 1.6 and 16, and a drive that acts as ``late``."""
    w = (1.6 + 16.0 / S) * late / (0.0022 * S + 0.018)
    return 20.0 * w / S / (1 + w + 20.0 * w / S)


@pytest.mark.parametrize(
    ("model", "options", "dead"),
    [
        (VISCOUS, {"delay": 1e-3}, (1e-3,)),
        (late_model(1e-3), {}, (1e-3,)),
        (late_model(5e-4), {"delay": 1e-3}, (1.5e-3,)),
    ],
)
def test_the_response_of_a_cascade_holds_the_exact_dead_time(model, options, dead):
    loop = lg.cascade_loop(model, kv=20.0, kp=1.6, ki=16.0, **options)
    T = lg.linearize(loop, input="r", output="theta")
    assert T.dead_times == pytest.approx(dead)
    assert T(S) == pytest.approx(cascade(np.exp(-S * dead[0])), rel=1e-6)


def test_without_a_dead_time_it_is_a_state_space_model():
    loop = lg.cascade_loop(late_model(0.0), kv=20.0, kp=1.6, ki=16.0)
    T = lg.linearize(loop, input="r", output="theta")
    assert isinstance(T, ct.StateSpace) and T.nstates == loop.nstates - 2
    assert T(S) == pytest.approx(cascade(1.0), rel=1e-6)
    whole = lg.linearize(loop)
    assert (whole.input_labels, whole.output_labels) == (loop.input_labels, loop.output_labels)


def test_the_operating_point_and_the_parameters_count():
    """A Stribeck drive at 0.02 rad/s has a falling friction curve, with its own slope."""
    p = lg.Model.of(J=0.0022, friction="stribeck", Fc=0.2, Fs=0.4, vs=0.01, Fv=0.02, effects=[
        {"name": "input_delay", "delay": 1e-3},
    ])  # fmt: skip
    drive = lg.plant(p)
    speed = 0.02
    states = np.zeros(drive.nstates)
    states[drive.state_index["w"]] = speed
    curve = lambda w: 0.2 + 0.2 * np.exp(-((w / 0.01) ** 2)) + 0.02 * w  # noqa: E731
    slope = (curve(speed + 1e-6) - curve(speed - 1e-6)) / 2e-6
    for late, given in ((1e-3, None), (4e-3, {"plant.input_delay.delay": 4e-3})):
        T = lg.linearize(drive, states, [0.0, 0.0], input="u", output="w", params=given)
        assert T(S) == pytest.approx(np.exp(-S * late) / (0.0022 * S + slope), rel=1e-4)


def test_wrong_arguments_are_named():
    loop = lg.cascade_loop(VISCOUS, delay=1e-3)
    with pytest.raises(InputError, match="give output=, one of theta, w"):
        lg.linearize(loop, input="r")
    with pytest.raises(InputError, match="input is 'x', but there is r"):
        lg.linearize(loop, input="x", output="w")
    with pytest.raises(InputError, match="x0 needs"):
        lg.linearize(loop, [1.0, 2.0], input="r", output="w")
    for odd in (np.nan, [np.inf] * loop.nstates):
        with pytest.raises(InputError, match="x0 must be finite"):
            lg.linearize(loop, odd, input="r", output="w")
    with pytest.raises(InputError, match="continuous"):
        lg.linearize(lg.dead_time(2e-3, dt=1e-3))


def speed_loop(delay, *more):
    """A PI closed over w of a plant that has theta too."""
    model = late_model(delay) if delay else VISCOUS
    blocks = [lg.plant(model), lg.pi(kp=1.6, ki=16.0), lg.error(), *more]
    outputs = ["w", "theta"]
    return ct.interconnect(blocks, inputs=["r"], outputs=outputs, params={}, check_unused=False)


@pytest.mark.parametrize("output", ["w", "theta"])
def test_a_position_outside_the_loop_is_no_mode_of_it(output):
    T = lg.linearize(speed_loop(1e-3), input="r", output=output)
    check = lg.stability_check(T.open_loop)
    own = lg.stability_check(lg.delayed(((1.6, 16.0), (0.0022, 0.018, 0.0)), 1e-3))
    assert check and "cancelled" not in check.reason
    assert check.delay_margin == pytest.approx(own.delay_margin, rel=1e-6)
    assert T.open_loop.cancelled == (1,)
    assert bool(lg.bandwidth_check(T).stable) is (output == "w")  # theta itself goes on


def test_a_mode_that_a_state_reads_is_still_said():
    """An unstable filter beside the loop is no position: nothing bounds it."""
    wild = ct.ss([[3.0]], [[1.0]], [[1.0]], [[0.0]], inputs="w", outputs="y", name="wild")
    T = lg.linearize(speed_loop(1e-3, wild), input="r", output="w")
    assert "s = +3 1/s" in lg.stability_check(T.open_loop).reason
