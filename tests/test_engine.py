"""The engine against python-control, SciPy, closed forms and plain loops."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import lugrectl as lg
from lugrectl.engine import AlgebraicLoop, Lanes, TraceError, trace
from lugrectl.engine.derivative import derivatives
from lugrectl.engine.graph import Graph, evaluate
from lugrectl.errors import InputError
from lugrectl.model import model_from_dict

DT = 1e-3


def full_model() -> lg.Model:
    """Table 1 with an effect of each kind: input (two states), level on time, torque, sign."""
    return (
        lg.Model.of(lg.table1())
        .with_effect("input_delay", {"delay": 0.003})
        .with_effect("friction_step", {"ratio": 0.3, "time": 0.1})
        .with_effect("gravity", {"amplitude": 0.2, "phase": 0.4})
        .with_effect("viscous_asymmetry", {"ratio": 0.2})
        .with_effect("quadratic_drag", {"coefficient": 0.01})
    )


def pi(kp: float = 1.6, ki: float = 0.16) -> ct.NonlinearIOSystem:
    """u = -kp e - ki q, dq/dt = e."""
    return ct.nlsys(
        lambda t, x, u, p: u[0],
        lambda t, x, u, p: -p["pi.kp"] * u[0] - p["pi.ki"] * x[0],
        inputs="e",
        outputs="u",
        states="q",
        params={"pi.kp": kp, "pi.ki": ki},
        name="pi",
    )


def velocity_loop(plant: ct.NonlinearIOSystem) -> ct.InterconnectedSystem:
    error = ct.summing_junction(["w", "-r"], "e", name="error")
    blocks = [plant, pi(), error]
    return ct.interconnect(
        blocks, inputs="r", outputs=["w", "F", "u"], params={}, check_unused=False, name="loop"
    )


def torque(samples: int, amplitude: float = 0.5) -> np.ndarray:
    t = np.arange(samples) * DT
    wave = np.sin(2 * np.pi * 5 * t) + 0.4 * np.sin(2 * np.pi * 17 * t)
    return np.column_stack([amplitude * wave, np.zeros(samples)])


@pytest.mark.parametrize("law", ["lugre", "stribeck", "coulomb", "viscous"])
def test_trace_is_the_systems_own_right_hand_side(law: str) -> None:
    model = model_from_dict({"plant": {"J": 0.01}, "friction": {"model": law}}, "test")
    model = model.with_values(
        {k: p.value for k, p in model.declarations().items() if model.values()[k] is None}
    )
    _assert_same_equations(lg.plant(model.with_effect("gravity", {"amplitude": 0.2, "phase": 1.0})))


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


def test_parameters_stay_arguments() -> None:
    plant = lg.plant(lg.table1())
    program = trace(plant)
    changed = {"plant.Fc": 0.2, "plant.J": 0.01}
    x, u = np.array([0.1, 0.3, 1e-3]), np.array([0.5, 0.1])
    xdot, _ = program.values(0.0, x, u, program.arguments(changed))
    np.testing.assert_allclose(xdot, plant.dynamics(0.0, x, u, changed), rtol=1e-14)


def test_one_key_with_two_defaults_gives_two_parameters() -> None:
    def block(name: str, gain: float) -> ct.NonlinearIOSystem:
        return ct.nlsys(
            None,
            lambda t, x, u, p: p["k"] * u[0],
            inputs="u",
            outputs=f"y{name}",
            params={"k": gain},
            name=name,
            dt=None,
        )

    blocks = [block("A", 1.0), block("B", 2.0)]
    both = ct.interconnect(blocks, inputs="u", outputs=["yA", "yB"], params={})
    program = trace(both)
    assert program.parameters == ("A:k", "B:k")
    _, y = program.values(0.0, [], [3.0])
    assert y.tolist() == [3.0, 6.0]
    assert program.arguments({"k": 5.0}).tolist() == [5.0, 5.0]


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


@settings(max_examples=60, deadline=None)
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
    step = 1e-5
    high, low = (build([a + s, b])[-1] for s in (step, -step))
    if abs(high) < 1e3 and abs(exact) < 1e3:
        assert exact == pytest.approx((high - low) / (2 * step), rel=1e-5, abs=1e-5)


def test_algebraic_loop_names_its_blocks_only() -> None:
    def gain(name: str, source: str, target: str) -> ct.NonlinearIOSystem:
        return ct.nlsys(
            None, lambda t, x, u, p: 0.5 * u[0], inputs=source, outputs=target, name=name, dt=None
        )

    blocks = [gain("one", "a", "b"), gain("two", "b", "a"), gain("after", "b", "c")]
    with pytest.raises(AlgebraicLoop, match="through one, two;"):
        trace(ct.interconnect(blocks, inputs="a", outputs="c", check_unused=False))


@pytest.mark.parametrize(
    ("function", "why"),
    [
        (lambda t, x, u, p: -x[0] if x[0] > 0 else x[0], "branch"),
        (lambda t, x, u, p: -float(x[0]), "number"),
        (lambda t, x, u, p: -max(x[0], 0.0), "branch"),
        (lambda t, x, u, p: np.floor(x[0]), "floor"),
    ],
)
def test_what_cannot_be_followed_is_named_with_its_line(function, why: str) -> None:
    block = ct.nlsys(function, None, states=1, inputs=1, outputs=1, name="odd")
    with pytest.raises(TraceError, match=f"block odd, .*test_engine.py line .*{why}"):
        trace(block)


def test_a_parameter_needed_as_a_number_is_taken_as_one() -> None:
    def update(t, x, u, p):
        return -x[0] * p["rate"] if p["decays"] > 0 else x[0] * p["rate"]

    block = ct.nlsys(
        update, None, states=1, inputs=0, outputs=1, name="b", params={"rate": 2.0, "decays": 1}
    )
    program = trace(block)
    assert dict(program.fixed) == {"rate": 2.0, "decays": 1}
    assert program.values(0.0, [3.0], [])[0].tolist() == [-6.0]


def test_a_block_with_a_memory_of_its_own_is_not_trusted() -> None:
    calls = []

    def update(t, x, u, p):
        calls.append(1)
        return -len(calls) * x[0]

    with pytest.raises(TraceError, match="differs"):
        trace(ct.nlsys(update, None, states=1, inputs=0, outputs=1, name="counter"))


def test_discrete_time_is_refused() -> None:
    with pytest.raises(InputError, match="discrete"):
        trace(ct.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], dt=0.1))


def runs(system, backend: str, count: int = 3, samples: int = 200, **options):
    lanes = Lanes(system, backend=backend)
    random = np.random.default_rng(5)
    p = lanes.defaults * random.uniform(0.9, 1.1, (count, len(lanes.defaults)))
    x0 = 1e-3 * random.standard_normal((count, len(lanes.states)))
    u = torque(samples)[:, : len(lanes.inputs)]
    start = np.arange(count) * 10
    return lanes.run(x0, start, samples - 10 * count, u, p, dt=DT, **options)


@pytest.mark.parametrize(
    "make", [lambda: lg.plant(full_model()), lambda: velocity_loop(lg.plant(lg.table1()))]
)
def test_both_backends_give_the_same_numbers(make) -> None:
    pytest.importorskip("numba")
    compiled, arrays = runs(make(), "numba"), runs(make(), "numpy")
    for a, b in zip(compiled, arrays, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-12)


def held_radau(system, u: np.ndarray, x0: np.ndarray) -> np.ndarray:
    """States at the samples, integrated interval by interval."""
    system._update_params(None)
    states = [np.asarray(x0, dtype=float)]
    for k, held in enumerate(u[:-1]):
        part = solve_ivp(
            lambda t, x, held=held: system._rhs(t, x, held),
            (k * DT, (k + 1) * DT),
            states[-1],
            method="Radau",
            rtol=1e-7,
            atol=1e-12,
        )
        states.append(part.y[:, -1])
    return np.array(states)


STIFF = lg.Parameters(J=1.0, sigma0=1e5, sigma1=316.0, Fc=1.0, Fs=1.5, Fv=0.4, vs=1e-3)


@pytest.mark.parametrize(("parameters", "amplitude"), [(lg.table1(), 0.5), (STIFF, 3.0)])
def test_lanes_against_radau(parameters: lg.Parameters, amplitude: float) -> None:
    plant, u = lg.plant(parameters), torque(60, amplitude)
    lanes = Lanes(plant, outputs=["theta", "w"])
    y, _ = lanes.run(np.zeros((1, 3)), [0], 60, u, lanes.defaults[None], dt=DT)
    exact = held_radau(plant, u, np.zeros(3))[:, :2]
    assert np.max(np.abs(y[0] - exact) / np.max(np.abs(exact), axis=0)) < 2e-5


@pytest.mark.parametrize("law", ["coulomb", "stribeck"])
def test_static_friction_laws_through_zero_speed(law: str) -> None:
    friction = {"model": law, "Fc": 0.285, "Fv": 0.018}
    friction |= {"Fs": 0.335, "vs": 0.01} if law == "stribeck" else {}
    model = model_from_dict({"plant": {"J": 0.0022}, "friction": friction}, "test")
    plant, u = lg.plant(model), torque(120)
    lanes = Lanes(plant, outputs=["theta", "w"])
    y, _ = lanes.run(np.zeros((1, 2)), [0], 120, u, lanes.defaults[None], dt=DT)
    exact = held_radau(plant, u, np.zeros(2))
    assert np.max(np.abs(y[0] - exact) / np.max(np.abs(exact), axis=0)) < 5e-3


@pytest.fixture(params=["numpy", "numba"])
def backend(request: pytest.FixtureRequest) -> str:
    if request.param == "numba":
        pytest.importorskip("numba")
    return request.param


def lag_block() -> ct.NonlinearIOSystem:
    """dx/dt = a (u - x): a step of length h is x + (1 - e^(-a h)) (u - x)."""
    return ct.nlsys(
        lambda t, x, u, p: p["a"] * (u[0] - x[0]),
        None,
        inputs="u",
        outputs="x",
        states="x",
        params={"a": 40.0},
        name="lag",
    )


def test_correction_is_made_before_the_interval(backend: str) -> None:
    """A plain loop with the closed form of each interval; nan leaves the state alone."""
    random = np.random.default_rng(2)
    u, y = random.standard_normal((30, 1)), random.standard_normal((30, 1))
    y[7:9] = np.nan
    lanes = Lanes(lag_block(), backend=backend)
    rates, starts, gain = np.array([40.0, 90.0]), [0, 5], np.array([[[0.2]], [[0.5]]])
    got, end = lanes.run(
        np.ones((2, 1)), starts, 20, u, rates[:, None], dt=DT, y=y, gain=gain, t0=3.0
    )
    for lane in range(2):
        x = 1.0
        for j in range(20):
            k = starts[lane] + j
            assert got[lane, j, 0] == pytest.approx(x, abs=1e-8)
            x += 0.0 if np.isnan(y[k, 0]) else gain[lane, 0, 0] * (y[k, 0] - x)
            x += (1 - np.exp(-rates[lane] * DT)) * (u[k, 0] - x)
        assert end[lane, 0] == pytest.approx(x, abs=1e-8)


def test_rows_for_substeps_and_input_sets(backend: str) -> None:
    u = np.random.default_rng(4).standard_normal((2, 40, 1))
    lanes = Lanes(lag_block(), backend=backend)
    got, _ = lanes.run(
        np.zeros((2, 1)),
        [0, 3],
        7,
        u,
        np.full((2, 1), 40.0),
        dt=DT,
        substeps=4,
        series=[1, 0],
        per_substep=True,
    )
    for lane, (own, start) in enumerate([(1, 0), (0, 3)]):
        x = 0.0
        for j in range(7):
            assert got[lane, j, 0] == pytest.approx(x, abs=1e-9)
            for held in u[own, 4 * (start + j) : 4 * (start + j + 1), 0]:
                x += (1 - np.exp(-40.0 * DT / 4)) * (held - x)


def test_a_step_in_time_counts_by_its_share(backend: str) -> None:
    """dx/dt = 1 from t0 on: the integral is exact for any t0 in the step."""
    block = ct.nlsys(
        lambda t, x, u, p: np.where(t >= p["t0"], 1.0, 0.0) + 0.0 * x[0],
        None,
        inputs=0,
        outputs="x",
        states="x",
        params={"t0": 0.0},
        name="late",
    )
    lanes = Lanes(block, backend=backend)
    late = np.array([0.0, 0.0031, 0.00425, 0.005, 1.0])
    _, end = lanes.run(np.zeros((5, 1)), 0, 10, np.zeros((10, 0)), late[:, None], dt=DT)
    np.testing.assert_allclose(end[:, 0], np.maximum(0.01 - late, 0.0), atol=1e-15)


def test_one_lane_that_blows_up_leaves_the_others_alone(backend: str) -> None:
    block = ct.nlsys(
        lambda t, x, u, p: p["a"] * x[0] ** 3 + u[0],
        None,
        inputs="u",
        outputs="x",
        states="x",
        params={"a": -1.0},
        name="cubic",
    )
    lanes = Lanes(block, backend=backend)
    p = np.array([[-1.0], [1e6], [-1.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        y, end = lanes.run(np.ones((3, 1)), 0, 50, np.zeros((50, 1)), p, dt=DT)
    assert not np.isfinite(end[1, 0])
    np.testing.assert_allclose(
        y[[0, 2], :, 0], (1 / np.sqrt(1 + 2 * DT * np.arange(50)),) * 2, rtol=1e-6
    )


def test_order_four_without_step_control(backend: str) -> None:
    """dx/dt = -x^2 cos t has x = 1/(1 + sin t): halving the step divides the error by 16."""
    block = ct.nlsys(
        lambda t, x, u, p: -(x[0] ** 2) * np.cos(t),
        None,
        inputs=0,
        outputs="x",
        states="x",
        name="riccati",
    )
    lanes = Lanes(block, backend=backend)
    errors = []
    for substeps in (1, 2, 4):
        _, end = lanes.run(
            np.ones((1, 1)),
            0,
            10,
            np.zeros((10, 0)),
            np.zeros((1, 0)),
            dt=0.1,
            substeps=substeps,
            rtol=np.inf,
        )
        errors.append(abs(end[0, 0] - 1 / (1 + np.sin(1.0))))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4.0) < 0.4)


def test_wrong_shapes_are_said(backend: str) -> None:
    lanes = Lanes(lg.plant(lg.table1()), backend=backend)
    p, u = lanes.defaults[None], np.zeros((10, 2))
    with pytest.raises(InputError, match="x0 needs the columns theta, w, z"):
        lanes.run(np.zeros((1, 2)), 0, 10, u, p, dt=DT)
    with pytest.raises(InputError, match="start must lie between 0 and 5"):
        lanes.run(np.zeros((1, 3)), 6, 5, u, p, dt=DT)
    with pytest.raises(InputError, match="u needs the columns u, d"):
        lanes.run(np.zeros((1, 3)), 0, 5, u[:, :1], p, dt=DT)
    with pytest.raises(InputError, match="no output 'q'"):
        Lanes(lg.plant(lg.table1()), outputs=["q"])


CHILD = """
import sys, numpy as np, control as ct
from lugrectl.engine import Lanes
block = ct.nlsys(lambda t, x, u, p: -p["a"] * x[0], None, inputs=0, outputs="x", states="x",
                 params={"a": 1.0}, name="decay")
lanes = Lanes(block)
lanes.run(np.ones((1, 1)), 0, 5, np.zeros((5, 0)), np.ones((1, 1)), dt=0.1)
print(sum(lanes._run.stats.cache_hits.values()), sum(lanes._run.stats.cache_misses.values()))
"""


def test_a_second_process_finds_the_compiled_code(tmp_path) -> None:
    pytest.importorskip("numba")
    environment = os.environ | {
        "LUGRECTL_CACHE": str(tmp_path),
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
    }
    counts = [
        subprocess.run(
            [sys.executable, "-c", CHILD],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for _ in range(2)
    ]
    assert counts == [["0", "1"], ["1", "0"]]
    assert [path.suffix for path in tmp_path.glob("*.p*")] == [".py"]


def test_a_cache_that_cannot_be_written_is_replaced(tmp_path, monkeypatch) -> None:
    from lugrectl.engine import load

    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LUGRECTL_CACHE", str(tmp_path / "file" / "below"))
    assert load.cache_dir().is_dir()
