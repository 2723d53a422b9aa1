"""Blocks that round, wrap or select are compiled: steps end where the value jumps."""

from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import Adaptive, trace
from lugrectl.engine.expression.graph import Graph, evaluate

from ..cases.own import moving, user_block
from ..conftest import there

T = np.linspace(0, 3, 31)


def select(v):
    return np.select([v > 1, v > 0.5], [1.0, 2.0 * v], 3.0)


FUNCTIONS = {
    "floor": np.floor,
    "ceil": np.ceil,
    "trunc": np.trunc,
    "fix": np.fix,
    "rint": np.rint,
    "round": np.round,
    "round to digits": lambda v: np.round(v, 1),
    "Python's round": lambda v: round(v),
    "math.floor": lambda v: math.floor(v),
    "mod": lambda v: np.mod(v, 0.7),
    "%": lambda v: v % -0.7,
    "fmod": lambda v: np.fmod(v, 0.7),
    "//": lambda v: v // 0.7,
    "select": select,
}


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_the_value_is_that_of_numpy(function):
    graph = Graph()
    x = graph.symbol("x")
    node = function(x)
    points = [*np.random.default_rng(0).normal(0, 3, 50), 0.0, 1.0, -2.0, 0.5, 1.5, -0.5, 0.25]
    for value in map(np.float64, points):
        (found,) = evaluate([node], {"x": value})
        assert found == pytest.approx(float(function(value)), abs=1e-12), value


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_its_integral_is_right_and_no_warning_is_given(function):
    """x' = f(t - 1): the same sum by fine steps."""
    block = moving(lambda t, x, u, p: np.array([function(t - 1.0) + 0.0 * x[0]]), "y", "rounds")
    fine = (np.arange(300_000) + 0.5) * 1e-5
    right = 1e-5 * sum(float(function(np.float64(v))) for v in fine[::10] - 1.0) * 10
    assert lg.simulate(block, T, 0.0).outputs[-1] == pytest.approx(right, abs=2e-4)


def quantised():
    """Speed control on a coarse encoder: u = -4 round(x / q) q, q = 0.1, and a push."""
    return moving(
        lambda t, x, u, p: np.array([x[1], -0.5 * np.round(x[0] / 0.1) * 0.1 - 0.4 * x[1] + u[0]]),
        ["x", "v"],
        "coarse",
    )


def test_a_coarse_encoder_in_a_loop_is_right():
    push = 0.2 * np.cos(T)
    found = lg.simulate(quantised(), T, push, [1.0, 0.0]).outputs[0]
    own = ct.input_output_response(
        quantised(), T, push, [1.0, 0.0], solve_ivp_kwargs={"rtol": 1e-9, "max_step": 1e-3}
    )
    assert found == pytest.approx(own.outputs[0], abs=2e-4)


@pytest.mark.parametrize("backend", ["python", "c"])
def test_every_backend_rounds_alike(backend):
    engine = Adaptive(trace(quantised()), there(backend))
    u, start = 0.2 * np.cos(T)[None], np.array([1.0, 0.0])
    run = engine.run(T, u, start, np.zeros(0), hold=False, rtol=1e-8)
    usual = lg.simulate(quantised(), T, u[0], start).states
    assert run.states == pytest.approx(usual, abs=1e-5)


def test_a_sampled_block_that_rounds_is_traced():
    held = user_block(
        lambda t, x, u, p: np.array([np.round(10 * u[0]) / 10]),
        lambda t, x, u, p: np.array([x[0]]),
        "v",
        "q",
        "q",
        "adc",
        dt=0.1,
    )
    t = 0.1 * np.arange(1200)
    found = lg.simulate(held, t, np.sin(t)).outputs
    assert found[1:] == pytest.approx(np.round(10 * np.sin(t[:-1])) / 10)
