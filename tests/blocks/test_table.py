"""A table over a signal as a block."""

import control as ct
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.core.errors import InputError


def value(block, x, t=0.0, params=None):
    return float(block.output(t, [], np.atleast_1d(x), params=params)[0])


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12),
    st.floats(-3.0, 15.0),
    st.floats(0.1, 2.0),
)
def test_a_table_is_the_line_through_its_points(values, x, step):
    points = step * np.arange(len(values))
    block = lg.tabulated("theta", points, values)
    bends = np.abs(np.diff(np.r_[values[0], values, values[-1]], 2)).max()
    # corners are rounded over 2 % of the step; each adds at most width^2/(4 distance) elsewhere
    assert value(block, x) == pytest.approx(np.interp(x, points, values), abs=0.03 * bends + 1e-12)


@given(st.floats(-20.0, 20.0), st.integers(-3, 3))
@example(np.pi, -1)  # the place where an angle is wrapped
def test_a_periodic_table_repeats_every_turn(x, turns):
    points = np.array([-2.5, -1.0, 0.2, 1.5, 3.0])
    values = np.array([0.3, -0.2, 0.1, 0.4, -0.1])
    block = lg.tabulated("theta", points, values, periodic=True)
    assert value(block, x) == pytest.approx(value(block, x + 2 * np.pi * turns), abs=1e-9)
    expected = np.interp(x, points, values, period=2 * np.pi)
    assert value(block, x) == pytest.approx(expected, abs=0.02)


def test_two_rows_are_the_two_directions():
    block = lg.tabulated("theta", [0.0, 1.0, 2.0], [[0.1, 0.2, 0.2], [-0.3, -0.1, 0.0]])
    assert block.input_labels == ["theta", "w"]
    forward, back = (value(block, [0.5, w]) for w in (0.1, -0.1))
    assert forward == pytest.approx(0.15, abs=0.003) and back == pytest.approx(-0.2, abs=0.005)
    assert value(block, [0.5, 0.0]) == pytest.approx(0.5 * (forward + back))


def test_a_table_over_time_has_no_input_and_a_scale_switches_it_off():
    block = lg.tabulated("t", [0.0, 2.0], [0.0, 1.0], name="late")
    assert not block.input_labels and block.output_labels == ["d"]
    assert value(block, [], t=1.0) == pytest.approx(0.5, abs=1e-3)
    assert value(block, [], t=1.0, params={"late.scale": 0.0}) == 0.0


@pytest.mark.parametrize(
    "arguments, periodic",
    [
        (("z", [0, 1], [0, 1]), False),
        (("theta", [0, 0], [0, 1]), False),
        (("theta", [0], [1]), False),
        (("theta", [0, 1], [0, 1, 2]), False),
        (("theta", [0, 1], [0, np.nan]), False),
        (("w", [0, 1], [[0, 1], [0, 1]]), False),
        (("w", [0, 1], [0, 1]), True),
        (("theta", [0, 7], [0, 1]), True),
    ],
)
def test_what_is_no_table_is_said(arguments, periodic):
    with pytest.raises(InputError, match="table"):
        lg.tabulated(*arguments, periodic=periodic)


def test_the_engine_traces_a_table_as_python_control_evaluates_it():
    points = np.linspace(-1.5, 1.5, 7)
    values = np.array([0.05 * np.sin(3 * points), -0.03 + 0.02 * points])
    block = lg.tabulated("theta", points, values)
    loop = ct.interconnect(
        [lg.plant(lg.table1()), block],
        inputs=["u"],
        outputs=["theta", "w", "d"],
        params={},
        check_unused=False,
    )
    t = np.linspace(0.0, 1.0, 201)
    u = 0.6 * np.sin(6.0 * t)
    fast = lg.simulate(loop, t, u)
    options = {"rtol": 1e-8, "atol": 1e-10}
    slow = ct.input_output_response(loop, t, u, solve_ivp_method="LSODA", solve_ivp_kwargs=options)
    assert np.ptp(slow.outputs[0]) > 1.0
    for a, b in zip(fast.outputs, slow.outputs, strict=True):
        differ = np.abs(a - b)[1:]  # at first it rests, held by friction, which tanh(0) is not
        assert np.max(differ) < 2e-3 * np.ptp(b)
