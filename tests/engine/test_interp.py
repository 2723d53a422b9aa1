"""np.interp in a user's block: followed as hinges, exact to the last kink."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import TraceError, trace
from lugrectl.engine.expression.graph import Graph, derivatives, evaluate
from lugrectl.engine.runtime import adaptive_run
from lugrectl.engine.runtime.adaptive_run import Adaptive

from ..cases.own import moving
from ..conftest import there

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


def test_the_derivative_is_the_slope_of_each_piece() -> None:
    graph = Graph()
    a = graph.symbol("a")
    slope = derivatives([np.interp(a, XP, FP)], a)  # pyright: ignore[reportArgumentType, reportCallIssue]
    middle = 0.5 * (np.array(XP[1:]) + XP[:-1])
    ours = evaluate(slope, {"a": np.r_[-9.0, middle, 9.0]})[0]
    np.testing.assert_allclose(ours, np.r_[0.0, np.diff(FP) / np.diff(XP), 0.0], atol=1e-13)


@pytest.mark.parametrize("backend", ["python", "c"])
def test_a_run_over_a_kink_is_the_closed_form(backend: str) -> None:
    """x' = 1 + x up to x = 1 at ln 2, then 3 - x."""
    engine = Adaptive(
        trace(_table(lambda t, x, u, p: np.interp(x, [0.0, 1.0, 3.0], [1.0, 2.0, 0.0]))),
        there(backend),
    )
    t = np.linspace(0.0, 2.0, 9)
    run = engine.run(t, np.empty((0, 9)), np.zeros(1), np.zeros(0), hold=False, rtol=1e-8)
    exact = np.where(t < np.log(2), np.expm1(t), 3 - 4 * np.exp(-t))
    np.testing.assert_allclose(run.states[0], exact, rtol=0, atol=1e-7)


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


@pytest.mark.slow
@pytest.mark.parametrize("way", ["c", "numba"])
def test_many_branches_are_compiled(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """numba follows the branches of a function by recursion, deeper than Python's usual limit."""
    made_by = there(way)
    monkeypatch.setattr(adaptive_run, "compiler", lambda: made_by)
    monkeypatch.setattr("lugrectl.engine.runtime.memo._traced", {})
    at = np.linspace(-1.0, 1.0, 40)
    many = _table(lambda t, x, u, p: 1.0 - sum(0.1 * np.maximum(x[0] - a, 0.0) for a in at) - x[0])
    table = np.interp  # the same function as a table of its corners
    corners = 1.0 - np.array([np.sum(0.1 * np.maximum(a - at, 0.0)) for a in (*at, 3.0)])
    one = _table(lambda t, x, u, p: table(x[0], [*at, 3.0], corners) - x[0])
    t = np.linspace(0.0, 5.0, 50)
    ours, same = (lg.simulate(block, t, x0=-2.0).outputs for block in (many, one))
    np.testing.assert_allclose(ours, same, rtol=0, atol=1e-6)
