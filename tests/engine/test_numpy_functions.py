"""Blocks that round or wrap are compiled: steps end where the value jumps."""

from __future__ import annotations

import math
from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import TraceError, trace
from lugrectl.engine.graph import Graph, evaluate

from ..cases.own import moving
from ..cases.systems import engine_run
from ..conftest import there

T = np.linspace(0, 3, 31)


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


# np.interp in a user's block: followed as hinges, exact to the last kink.


XP, FP = [-1.5, -0.25, 0.0, 0.5, 2.0], [0.3, -0.4, 0.1, 0.7, -0.2]
A = np.r_[np.random.default_rng(4).uniform(-3, 3, 200), XP]


def _table(function: Any, **options: Any) -> ct.NonlinearIOSystem:
    return moving(function, ["x"], "table", 0, **options)


@pytest.mark.parametrize(
    "expression",
    [
        lambda a: np.interp(a, XP, FP),
        lambda a: np.interp(2 * a, XP, FP, left=5.0, right=-5.0),
        lambda a: np.interp(a, XP, np.array(FP) * 3.0) + a,
        lambda a: np.interp(a, [0.5], [2.0]) + 0.0 * a,
    ],
)
def test_symbols_give_what_numpy_gives(expression: Any) -> None:
    graph = Graph()
    node = expression(graph.symbol("a"))
    ours = evaluate([node], {"a": A})[0]
    np.testing.assert_allclose(ours, expression(A), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("backend", ["python", "c"])
def test_a_run_over_a_kink_is_the_closed_form(backend: str) -> None:
    """x' = 1 + x up to x = 1 at ln 2, then 3 - x."""
    block = _table(lambda t, x, u, p: np.interp(x, [0.0, 1.0, 3.0], [1.0, 2.0, 0.0]))
    t = np.linspace(0.0, 2.0, 9)
    run = engine_run(block, there(backend), t, [0.0], rtol=1e-8)
    exact = np.where(t < np.log(2), np.expm1(t), 3 - 4 * np.exp(-t))
    np.testing.assert_allclose(run.x[0], exact, rtol=0, atol=1e-7)


def test_values_of_the_table_may_be_parameters_and_stay_arguments() -> None:
    block = _table(lambda t, x, u, p: np.interp(x[0], [0.0, 1.0], [p["a"], p["b"]]), a=1.0, b=2.0)
    assert set(trace(block).parameters) == {"a", "b"}


@pytest.mark.parametrize(
    ("function", "why"),
    [
        (lambda a: np.interp(a, XP, FP, period=4.0), "period"),
        (lambda a: np.interp(a, [0.0, 0.0, 1.0], [0.0, 1.0, 2.0]), "increasing points"),
        (lambda a: np.interp(a, np.arange(99.0), np.ones(99)), "99 points .* lg.tabulated"),
    ],
)
def test_what_is_not_followed_is_said_and_simulated_all_the_same(function: Any, why: str) -> None:
    block = _table(lambda t, x, u, p: [function(x[0]) - x[0]])
    with pytest.raises(TraceError, match=why):
        trace(block)
    t, fine = np.linspace(0.0, 1.0, 11), {"rtol": 1e-8, "max_step": 0.01}
    with pytest.warns(RuntimeWarning, match=why):
        ours = lg.simulate(block, t, x0=0.5)
    theirs = ct.input_output_response(block, t, 0, 0.5, solve_ivp_kwargs=fine)
    np.testing.assert_allclose(ours.outputs, theirs.outputs, atol=1e-5)
