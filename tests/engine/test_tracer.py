"""The engine against python-control, SciPy, closed forms and plain loops."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.engine import TraceError, trace
from lugrectl.engine.graph import Graph, derivatives, evaluate
from lugrectl.simulation.response import simulate

from ..cases.own import moving
from ..cases.systems import full_model, pi, velocity_loop


def test_trace_of_a_plant_with_effects_and_of_a_loop() -> None:
    plant = lg.plant(full_model())
    _assert_same_equations(plant)
    _assert_same_equations(velocity_loop(plant))


def _assert_same_equations(system: ct.NonlinearIOSystem) -> None:
    program = trace(system)
    random = np.random.default_rng(7)
    for _ in range(50):
        x, u = random.standard_normal(system.nstates), random.standard_normal(system.ninputs)
        t = random.uniform(0, 0.3)
        xdot, y = program.values(t, x, u)
        np.testing.assert_allclose(xdot, system.dynamics(t, x, u), rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(y, system.output(t, x, u), rtol=1e-14, atol=1e-14)


def test_state_space_and_nested_interconnections() -> None:
    lag = ct.ss(
        [[-3.0, 1.0], [0.0, -5.0]],
        [[0.0], [2.0]],
        [[1.0, 0.5]],
        [[0.1]],
        inputs="u",
        outputs="v",
        name="lag",
    )
    inner = ct.interconnect(
        [pi(), lag], inputs="e", outputs="v", params={}, check_unused=False, name="inner"
    )
    drive = lg.plant(lg.table1(), inputs=["v", "d"])
    error = ct.summing_junction(["w", "-r"], "e", name="error")
    _assert_same_equations(
        ct.interconnect(
            [drive, inner, error],
            inputs=["r", "d"],
            outputs=["w", "v"],
            params={},
            check_unused=False,
        )
    )


@pytest.mark.parametrize(
    "expression",
    [
        lambda a, b: np.exp(-a * a) / (1 + b**2),
        lambda a, b: np.tanh(a / 0.3) * np.abs(b) + np.sign(a),
        lambda a, b: np.where(a >= b, a * b, np.sin(a)),
        lambda a, b: np.clip(a + b, -0.5, 0.5) + np.maximum(a, 2 * b) - np.minimum(a, b),
        lambda a, b: np.sqrt(a**2 + 1) + np.log(b * b + 1) + np.arctan(a * b) + np.hypot(a, b),
        lambda a, b: np.where((a > 0) & ~(b > 1), np.cosh(a), np.sinh(b)) + np.square(a),
        lambda a, b: np.power(a * a + 1, b) + np.arctan2(a, b + 3) + np.heaviside(b, 0.5),
        lambda a, b: np.expm1(a) * np.log1p(b * b) + np.cos(a) / np.tan(b / 9 + 1) - abs(-a) ** 3,
    ],
)
def test_numpy_code_on_symbols_is_numpy_code_on_numbers(expression) -> None:
    graph = Graph()
    node = expression(graph.symbol("a"), graph.symbol("b"))
    a, b = np.random.default_rng(3).uniform(-2, 2, (2, 200))
    np.testing.assert_allclose(
        evaluate([node], {"a": a, "b": b})[0], expression(a, b), rtol=1e-13, atol=1e-13
    )


MATRIX = np.array([[-1.0, 2.0, 3.0], [0.0, -1.0, 2.0], [1.0, 0.0, -4.0]])


OPERATIONS = {
    "add": lambda a, b: a + b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / (1.5 + b * b),
    "exp": lambda a, b: np.exp(-a * a),
    "tanh": lambda a, b: np.tanh(a - b),
    "sin": lambda a, b: np.sin(a) - np.cos(b),
    "atan": lambda a, b: np.arctan(a) * b,
    "root": lambda a, b: np.sqrt(a * a + 0.5),
    "power": lambda a, b: (a * a + 0.5) ** (0.3 * b),
    "square": lambda a, b: np.square(a) - np.abs(b + 7.0),
}


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(st.sampled_from(sorted(OPERATIONS)), st.integers(0, 9), st.integers(0, 9)),
        min_size=1,
        max_size=8,
    ),
    st.floats(-1.5, 1.5),
    st.floats(-1.5, 1.5),
)
def test_derivative_is_the_limit_of_differences(recipe, a: float, b: float) -> None:
    def build(values: list) -> list:
        for name, i, j in recipe:
            values.append(OPERATIONS[name](values[i % len(values)], values[j % len(values)]))
        return values

    graph = Graph()
    symbols = [graph.symbol("a"), graph.symbol("b")]
    root = build(list(symbols))[-1]
    exact = float(evaluate(derivatives([root], symbols[0]), {"a": a, "b": b})[0])
    step = 1e-6  # of x |x| at 0 the difference is its step, times a factor
    high, low = (build([a + s, b])[-1] for s in (step, -step))
    if abs(high) < 1e3 and abs(exact) < 1e3:
        assert exact == pytest.approx((high - low) / (2 * step), rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(
    ("function", "why"),
    [
        (lambda t, x, u, p: -x[0] if x[0] > 0 else x[0], "branch"),
        (lambda t, x, u, p: -float(x[0]), "number"),
        (lambda t, x, u, p: -max(x[0], 0.0), "branch"),
        (lambda t, x, u, p: np.cbrt(x[0]), "cbrt"),
    ],
)
def test_what_cannot_be_followed_is_named_with_its_line(function, why: str) -> None:
    block = moving(function, 1, "odd", 1)
    with pytest.raises(TraceError, match=f"block odd, .*test_tracer.py line .*{why}"):
        trace(block)


def test_a_parameter_needed_as_a_number_is_taken_as_one() -> None:
    def update(t, x, u, p):
        return -x[0] * p["rate"] if p["decays"] > 0 else x[0] * p["rate"]

    block = moving(update, 1, "b", 0, rate=2.0, decays=1)
    program = trace(block)
    assert dict(program.fixed) == {"decays": 1}
    assert program.keys == ("rate",)
    assert program.values(0.0, [3.0], [], [5.0])[0].tolist() == [-15.0]


def counting(t, x, u, p):
    """n counts, b chooses; a and c are values."""
    total = p["c"] * x[0]
    for k in range(int(p["n"])):
        total = total + np.sin((k + 1) * x[0])
    return u[0] - p["a"] * x[0] + (0.1 if p["b"] > 0 else 0.2) * total


def test_a_parameter_that_counts_fixes_itself_alone() -> None:
    params = {"a": 1.0, "n": 3, "c": 0.5, "b": 1.0}
    block = moving(counting, 1, "counts", 1, **params)
    program = trace(block)
    assert dict(program.fixed) == {"n": 3, "b": 1.0} and set(program.keys) == {"a", "c"}
    t, found = np.linspace(0, 1, 5), []
    for n, a in ((3, 1.0), (3, 2.0), (2, 2.0)):  # each is followed
        values = {"n": n, "a": a}
        found.append(simulate(block, t, 1.0, params=values).outputs[-1])
        kwargs = {"rtol": 1e-9, "atol": 1e-12}
        own = ct.input_output_response(block, t, 1 + 0 * t, params=values, solve_ivp_kwargs=kwargs)
        assert found[-1] == pytest.approx(own.outputs[-1], rel=1e-5)
    assert len({round(y, 3) for y in found}) == 3


def test_discrete_time_is_refused() -> None:
    with pytest.raises(InputError, match="discrete"):
        trace(ct.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], dt=0.1))
