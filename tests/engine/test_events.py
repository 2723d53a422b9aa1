"""Kinks and jumps: where they are met, and that a run ends whatever its switching functions do."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.core.errors import Diverged

from ..cases.own import moving
from ..cases.systems import engine_run

pytestmark = pytest.mark.usefixtures("interpreted")

W = 5.0
Signal = Callable[[Any, Any], Any]


def turning(rate: Signal) -> ct.NonlinearIOSystem:
    """x0 = cos(W t), x1 its rate, and the integral of a function of them."""

    def update(t: Any, x: Any, u: Any, p: Any) -> Any:
        return np.array([x[1], -W * W * x[0], rate(t, x)])

    return moving(update, 3, "turning", 0)


def last(rate: Signal, t: np.ndarray, rtol: float = 1e-9) -> float:
    return lg.simulate(turning(rate), t, x0=[1.0, 0.0, 0.0], rtol=rtol).states[2, -1]


def area(wave: Callable[[np.ndarray], np.ndarray], end: float) -> float:
    """Its integral by the midpoint rule."""
    t = (np.arange(2_000_000) + 0.5) * end / 2_000_000
    return float(np.mean(wave(t)) * end)


ABSENT: dict[str, Signal] = {
    "zero": lambda t, x: np.abs(0.0 * np.maximum(x[0], x[1]) * x[0]),
    "zero up to rounding": lambda t, x: np.abs((x[0] + 1.0) - 1.0 - x[0]),
    "sign of zero": lambda t, x: np.sign(1e-300 * np.minimum(x[0] * x[0], 0.0)),
    "touches zero": lambda t, x: 0.0 * np.abs(1.0 - x[0]),
    "zero at last": lambda t, x: np.sign(np.maximum(0.4 - t, 0.0) * x[1]) + (t < 0.4),
    "zero, then not": lambda t, x: 0.0 * np.sign(np.maximum(t - 2.2, 0.0) * x[1]),
    "zero now and then": lambda t, x: 0.0 * np.abs(np.maximum(np.sin(9.0 * t), 0.0) * x[1]),
    "at least zero": lambda t, x: np.where(0.0 * x[0] >= 0.0, 0.0, 1.0),
    "above zero": lambda t, x: np.where(0.0 * x[0] > 0.0, 1.0, 0.0),
    "constant": lambda t, x: np.abs(3.0 + 0.0 * x[0]) - 3.0,
    "infinite": lambda t, x: np.clip(0.0 * x[0], -np.inf, np.inf),
}


@pytest.mark.parametrize("idle", ABSENT.values(), ids=ABSENT)
@pytest.mark.parametrize("points", [2, 120])
def test_a_function_at_zero_does_not_keep_others_from_being_met(idle: Signal, points: int) -> None:
    t = np.linspace(0.0, 5.5, points)
    exact = (18.0 - abs(np.sin(5.5 * W))) / W  # 17 quarters of a period, of 1/W each, and a part
    assert last(lambda t, x: np.abs(x[0]) + idle(t, x), t) == pytest.approx(exact, abs=1e-6)


def test_hundreds_of_kinks_within_one_interval_are_all_met() -> None:
    exact = area(lambda t: np.abs(np.cos(W * t)), 200.3)
    assert last(lambda t, x: np.abs(x[0]), np.array([0.0, 200.3])) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize(
    "rate",
    [
        lambda t, x: np.abs(np.sqrt(x[0])),
        lambda t, x: np.sign(np.sqrt(x[0])),
        lambda t, x: np.maximum(np.sqrt(x[0]), 0.5),
        lambda t, x: np.minimum(0.5, np.sqrt(x[0])),
    ],
)
def test_a_switching_function_that_is_no_number_ends_the_run(rate: Signal) -> None:
    """sqrt(cos W t) from t = pi / 10 on."""
    with pytest.raises(Diverged, match=r"state x\[2\] .* at t = 0.31"):
        last(rate, np.linspace(0.0, 5.0, 11))


def test_a_comparison_with_no_number_is_false_as_in_numpy() -> None:
    t = np.linspace(0.0, 5.5, 200)
    exact = area(lambda t: np.cos(W * t) > 0.25, 5.5)
    ours = last(lambda t, x: np.where(np.sqrt(x[0]) > 0.5, 1.0, 0.0), t)
    assert ours == pytest.approx(exact, abs=1e-5)


def test_what_cannot_be_followed_ends_soon_and_by_name() -> None:
    fast = moving(lambda t, x, u, p: np.array([np.sin(1e13 * t)]), 1, inputs=0)
    with pytest.raises(Diverged, match=r"state x\[0\] .* faster than steps can follow"):
        lg.simulate(fast, np.linspace(0.0, 5.0, 3))


PIECES = st.sampled_from(["abs", "sign", "where", "max", "zero", "touch", "late"])
NUMBERS = st.floats(-2.0, 2.0).map(lambda v: round(v, 2))


def _piece(name: str, a: Any, b: Any, t: Any) -> Any:
    made: dict[str, Callable[[], Any]] = {
        "abs": lambda: np.abs(a - b),
        "sign": lambda: np.sign(a),
        "where": lambda: np.where((a > b) & (a < 1.0), -a, b),
        "max": lambda: np.maximum(a, b) - np.clip(b, -0.3, 0.3),
        "zero": lambda: np.sign(0.0 * np.maximum(a, b)),
        "touch": lambda: np.abs(a * a),
        "late": lambda: np.abs(np.maximum(np.sin(7.0 * t), 0.0) * a),
    }
    return made[name]()


@settings(max_examples=15, derandomize=True)
@given(
    st.lists(st.tuples(PIECES, st.integers(0, 2), st.integers(0, 2), NUMBERS), max_size=5),
    st.lists(NUMBERS, min_size=9, max_size=9),
    st.lists(NUMBERS, min_size=3, max_size=3),
    st.integers(2, 6),
)
def test_every_run_ends(pieces: list, matrix: list, x0: list, points: int) -> None:
    """In states for all times, in a warning, or in Diverged, and in few steps."""

    def update(t: Any, x: Any, u: Any, p: Any) -> Any:
        rates = list(np.array(matrix).reshape(3, 3) @ np.array(x))
        for i, (name, j, k, gain) in enumerate(pieces):
            rates[i % 3] = rates[i % 3] + gain * _piece(name, x[j], x[k] - 0.5 * gain, t)
        return np.array(rates)

    system = moving(update, 3, "random", 0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            run = engine_run(system, "python", np.linspace(0.0, 2.0, points), x0, rtol=1e-5)
        except Diverged:
            return
    assert np.all(np.isfinite(run.x))
    assert run.steps < 20_000


ROOTS: dict[str, Callable[[Any], Any]] = {
    "root": lambda x: np.sign(x) * np.sqrt(np.abs(x)),
    "power below 1": lambda x: np.sign(x) * np.abs(x) ** 0.6,
    "power above 1": lambda x: x * np.abs(x) ** 0.5,
    "one side": lambda x: np.sqrt(np.maximum(x, 0.0)),
    "logarithm": lambda x: np.sign(x) * np.log(1.0 + np.abs(x)),
    "decades": lambda x: np.sign(x) * (3.0 + np.log10(np.abs(x) + 1e-3)),
}


@pytest.mark.cases
@pytest.mark.parametrize("name", ROOTS)
def test_a_root_of_a_magnitude_is_no_nan_beyond_its_switch(name: str) -> None:
    """From 0 on, and through 0: a step on one side would take the root of a negative number."""

    def update(t: Any, x: Any, u: Any, p: Any) -> Any:
        return np.array([u[0] - ROOTS[name](x[0])])

    system = moving(update, 1, name.replace(" ", "_"), 1)
    t = np.linspace(0.0, 2.2, 221)
    u = np.sin(3.0 * t) + 0.1
    found = lg.simulate(system, t, u, rtol=1e-8).states
    known = lg.simulate(system, t, u, method="RK45", rtol=1e-10, atol=1e-12).states
    np.testing.assert_allclose(found, known, atol=1e-6)
