"""Blocks whose rates are not affine in their states, in discrete time: found, and right."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.simulation.response import simulate
from lugrectl.simulation.sampled_block import sampled

from ..cases.own import user_block
from ..cases.sampled import DT, P, sine_error, step_response


def lone(rate, name="lone", **params):
    """dx/dt = rate(x, v, params), y = x."""
    return user_block(
        lambda t, x, u, p: [rate(x[0], u[0], p)],
        lambda t, x, u, p: [x[0]],
        ["v"],
        ["y"],
        ["x"],
        name,
        **params,
    )


def largest_difference(block, dt, v, seconds, params=None, method="LSODA"):
    """Of the sampled block, run by python-control, against the continuous one."""
    t = np.arange(0, seconds, dt)
    exact = simulate(block, t, v(t), rtol=1e-9, params=params, method=method).outputs
    found = ct.input_output_response(sampled(block, dt), t, v(t), params=params).outputs
    return np.abs(found - exact).max()


@pytest.mark.parametrize(
    ("rate", "v", "dt", "bound"),
    [
        (lambda x, v, p: v - 1000 * np.clip(x, -5, 5), lambda t: 8000 + 0 * t, 1e-3, 2e-3),
        (
            lambda x, v, p: v - 800 * np.where(np.abs(x) > 4, x - 4 * np.sign(x), 0.0),
            lambda t: 100 * np.sin(4 * np.pi * t),
            4e-3,
            1e-3,
        ),
        (lambda x, v, p: v - 3 * np.sign(x), lambda t: 2 * np.sin(9 * t), 0.01, 1e-4),
        (lambda x, v, p: v - x * x * x, lambda t: 50 * np.sin(20 * t), 5e-3, 1e-4),
    ],
    ids=["limited return", "stop", "sign", "cubic"],
)
def test_rates_that_are_affine_in_a_range_only_are_right(rate, v, dt, bound):
    rests = lone(rate).updfcn(0.0, [1e-9], [0.0], {})[0] < -1.0  # LSODA cannot follow that
    method = None if rests else "LSODA"
    assert largest_difference(lone(rate), dt, v, 0.3, method=method) < bound


@pytest.mark.parametrize("slope", [np.sqrt, np.log])
def test_a_nan_away_from_the_inputs_is_no_verdict(slope):
    """-sqrt(v) x and -log(v) x are affine, and exact while v is constant."""
    block = lone(lambda x, v, p: 1.0 - slope(v) * x)
    made = sampled(block, 0.1)
    y = step_response(made, np.full((1, 20), 3.0), [0.0, 3.0, 1.0], 20)[0]
    a = slope(3.0)
    assert y == pytest.approx((1 - np.exp(-a * 0.1 * np.arange(1, 21))) / a, rel=1e-12)


def test_the_adaptive_observer_follows_the_continuous_one():
    assert sine_error(lg.adaptive_observer(P), [1e-3, 0.1, 0.0], DT) < 1e-3


@pytest.mark.filterwarnings("ignore:block lone:RuntimeWarning")
@pytest.mark.parametrize("edge", [1e-5, 5.0, 1e5])
def test_a_branch_that_cannot_be_traced_is_found_at_any_size(edge):
    block = lone(lambda x, v, p: v - 100 * (x if x < edge else edge))
    assert largest_difference(block, 0.01, lambda t: 200 * edge + 0 * t, 0.1) < 1e-3 * edge


def test_a_state_that_grows_without_bound_is_named():
    block = lone(lambda x, v, p: x * x, name="burst")
    with pytest.raises(lg.Refused, match="burst: state x"):
        step_response(sampled(block, 1.0), np.zeros((1, 5)), [2.0], 5)
