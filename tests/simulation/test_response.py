"""simulate() against python-control with LSODA, closed forms, and what it must refuse."""

from __future__ import annotations

import math
import sys

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lugrectl as lg
from lugrectl.core.errors import Diverged, InputError
from lugrectl.simulation.response import simulate

from ..cases.own import static, user_block
from ..cases.systems import velocity_loop

pytestmark = pytest.mark.usefixtures("interpreted")

TIGHT = {"rtol": 1e-9, "atol": 1e-13}


def block(update, output=None, *, inputs=0, outputs=1, states=1, name="block", **options):
    return user_block(update, output, inputs, outputs, states, name, **options)


def reference(system, t, u, x0=0.0, *, jump: float = math.inf, method="LSODA", params=None):
    """States by solve_ivp on the system's own functions, restarted at each sample and jump."""
    system._update_params(params)
    u = np.atleast_2d(u)
    edges = np.sort(np.append(t, jump))[: len(t) + (jump < t[-1])]
    x = np.zeros(system.nstates) + x0
    kept = [x]
    for a, b in zip(edges, edges[1:], strict=False):
        part = solve_ivp(
            lambda s, y: system._rhs(s, y, [np.interp(s, t, row) for row in u]),
            (a, b),
            x,
            method,
            **TIGHT,
        )
        x = part.y[:, -1]
        kept += [x] if b != jump else []
    return np.array(kept).T


def worst(a, b) -> float:
    """Largest deviation of each row, relative to the row's largest value."""
    a, b = np.atleast_2d(a), np.atleast_2d(b)
    return float(np.max(np.max(np.abs(a - b), axis=1) / np.max(np.abs(b), axis=1)))


MANY = (
    lg.Model.of(lg.table1())
    .with_effect("actuator_lag", {"time_constant": 0.003})
    .with_effect("friction_step", {"ratio": 0.3, "time": 0.0103})
    .with_effect("coulomb_asymmetry", {"ratio": 0.1})
    .with_effect("gravity", {"amplitude": 0.2, "phase": 0.4})
)


@pytest.mark.cases
def test_many_effects_in_the_plant(way: str) -> None:
    loop, t = velocity_loop(lg.plant(MANY)), np.arange(0, 0.02, 1e-3)
    r = np.sin(2 * np.pi * 30 * t)
    assert worst(simulate(loop, t, r, rtol=1e-8).states, reference(loop, t, r, jump=0.0103)) < 1e-6


def test_a_static_block() -> None:
    t = np.linspace(0, 1, 5)
    system = static(lambda t, x, u, p: np.tanh(u) + t, 1, 1)
    ours, theirs = simulate(system, t, t**2), ct.input_output_response(system, t, t**2)
    np.testing.assert_allclose(ours.outputs, theirs.outputs)
    assert ours.output_labels == theirs.output_labels


@pytest.mark.parametrize("hold", [False, True])
def test_linear_system_in_closed_form(way: str, hold: bool) -> None:
    """dx/dt = A x + B u with held or linear input, on uneven times, by matrix exponentials."""
    a, b = np.array([[0.0, 1.0], [-400.0, -3.0]]), np.array([[0.0], [1.0]])
    system = ct.ss(a, b, np.eye(2), 0)
    random = np.random.default_rng(3)
    t = np.cumsum(random.uniform(0.001, 0.03, 60))
    u, x = random.standard_normal(60), np.array([1.0, 0.0])
    states = [x]
    for k in range(59):
        h, slope = t[k + 1] - t[k], 0.0 if hold else (u[k + 1] - u[k]) / (t[k + 1] - t[k])
        big = np.zeros((4, 4))
        big[:2, :2], big[:2, 2:3], big[2, 3] = a, b, 1.0
        x = (expm(big * h) @ np.array([*x, u[k], slope]))[:2]
        states.append(x)
    ours = simulate(system, t, u, [1.0, 0.0], hold=hold, rtol=1e-9)
    assert worst(ours.states, np.array(states).T) < 1e-7


def test_events_are_met_exactly(way: str) -> None:
    """dx/dt = sign(t - 0.3371) + 2 (t >= 0.6): corners of the integral on and off the grid."""
    system = block(
        lambda t, x, u, p: np.sign(t - 0.3371) + 2.0 * (t >= p["t0"]), params={"t0": 0.6}
    )
    t = np.linspace(0, 1, 11)
    for start in (0.6, 0.65):
        x = simulate(system, t, params={"t0": start}).states[0]
        exact = np.abs(t - 0.3371) - 0.3371 + 2 * np.maximum(t - start, 0)
        np.testing.assert_allclose(x, exact, atol=1e-9)


def test_a_relay_that_never_settles_is_said(way: str) -> None:
    """The swings of x'' = -sign(x) - sign(x')/2 shrink by 3 each: endless by t = 5.5."""
    swing = block(
        lambda t, x, u, p: np.array([x[1], -np.sign(x[0]) - 0.5 * np.sign(x[1])]),
        states=2,
        outputs=2,
    )
    with pytest.warns(RuntimeWarning, match="switches without end"):
        x = simulate(swing, np.linspace(0, 8, 21), x0=[1.0, 0.0]).states
    assert np.max(np.abs(x[:, -1])) < 1e-3


def test_other_parameters_need_no_new_code() -> None:
    loop, t = velocity_loop(lg.plant(lg.table1())), np.arange(0, 0.03, 1e-3)
    r = np.sin(50 * t)
    simulate(loop, t, r)
    changed = {"plant.Fc": 0.2, "pi.kp": 0.8}
    generated = [name for name in sys.modules if name.startswith("lugrectl_")]
    ours = simulate(loop, t, r, params=changed)
    assert [name for name in sys.modules if name.startswith("lugrectl_")] == generated
    assert worst(ours.states, reference(loop, t, r, params=changed)) < 2e-6
    assert ours.params == changed


@pytest.mark.parametrize("method", ["RK45", "Radau"])
def test_scipy_methods_linear_and_held(method: str) -> None:
    lag, t = ct.ss([[-2.0]], [[2.0]], [[1.0]], [[0.0]]), np.linspace(0, 1, 11)
    u = np.cos(9 * t)
    for hold in (False, True):
        ours = simulate(lag, t, u, hold=hold)
        theirs = simulate(lag, t, u, hold=hold, method=method, rtol=1e-8)
        np.testing.assert_allclose(ours.outputs, theirs.outputs, atol=1e-5)


def test_blow_up_names_state_and_time(way: str) -> None:
    """dx/dt = x^2 from 1 ends at t = 1; exp overflows in plain Python."""
    for rate in (
        lambda t, x, u, p: np.array([x[0] ** 2, 0.0]),
        lambda t, x, u, p: np.array([np.exp(x[0]) * np.exp(-1.0), 0.0]),
    ):
        system = block(rate, states=["big", "calm"], outputs=2, name="fuse")
        with pytest.raises(Diverged, match=r"fuse: state big .* t = 1 s"):
            simulate(system, np.linspace(0, 2, 9), x0=[1.0, 0.0])


def test_nan_names_signal_and_time() -> None:
    root = block(lambda t, x, u, p: np.sqrt(1.0 - t) + 0 * x[0], name="root")
    with pytest.raises(Diverged, match=r"root: state x\[0\] .* t = 1 s"):
        simulate(root, np.linspace(0, 2, 9))
    log = block(lambda t, x, u, p: -1.0 + 0 * x[0], lambda t, x, u, p: np.log(x[0]), name="log")
    with pytest.raises(Diverged, match=r"log: output y\[0\] is .* at t = 1 s"):
        simulate(log, np.linspace(0, 2, 9), x0=1.0)


def test_a_guarded_division_is_no_error(way: str) -> None:
    """The branch not taken may divide by zero, in a rate and in a condition."""
    safe = block(
        lambda t, x, u, p: np.where(
            p["a"] > 0, -x[0] / p["a"], np.where(x[0] > np.where(x[0] > 3, 1 / p["a"], 1.0), 0, 9)
        ),
        params={"a": 0.0},
    )
    assert simulate(safe, [0.0, 1.0], x0=2.0).states[0, -1] == 2.0


def test_wrong_use_is_said_in_one_sentence() -> None:
    loop, t = velocity_loop(lg.plant(lg.table1())), np.arange(0, 0.01, 1e-3)
    bad = np.ones(10)
    bad[4] = np.nan
    with pytest.raises(InputError, match="input r is nan at t = 0.004 s"):
        simulate(loop, t, bad)
    with pytest.raises(InputError, match="t must increase; after 2 s comes 1 s"):
        simulate(loop, [0, 2, 1], 0)
    with pytest.raises(InputError, match=r"inputs \(r\) of shape \(1, 10\)"):
        simulate(loop, t, np.ones(7))
    with pytest.raises(InputError, match="4 states, x0 has 5"):
        simulate(loop, t, 0, np.zeros(5))
    with pytest.raises(InputError, match="no block reads the parameter 'plant.Fx'"):
        simulate(loop, t, 0, params={"plant.Fx": 1.0})


def test_inputs_in_every_form_of_python_control_and_by_name() -> None:
    plant, t = lg.plant(lg.table1()), np.arange(0, 0.02, 1e-3)
    wave = 0.5 * np.sin(50 * t)
    expected = simulate(plant, t, np.vstack([wave, np.full(20, 0.1)])).states
    both = np.vstack([wave, wave * 0 + 0.1])
    for form in ([wave, 0.1], [wave, np.full(20, 0.1)], [both], {"d": 0.1, "u": wave}):
        np.testing.assert_array_equal(simulate(plant, t, form).states, expected)
    np.testing.assert_array_equal(simulate(plant, t).states, simulate(plant, t, 0.0).states)
    with pytest.raises(InputError, match="there is no external input 'x'; known: u, d"):
        simulate(plant, t, {"x": 1.0})


# What simulate() returns is used as python-control's own responses are.


@pytest.mark.slow
@pytest.mark.parametrize(("name", "squeeze"), [("siso", None), ("loop", True), ("loop", False)])
def test_the_response_is_used_as_python_controls(name: str, squeeze: bool | None) -> None:
    """Values, unpacking, indexing, keywords of a call, pandas and plot."""
    lag = ct.ss([[-1.0]], [[1.0]], [[2.0]], [[0.0]], name="lag", inputs="u", outputs="y")
    system = lag if name == "siso" else velocity_loop(lg.plant(lg.table1()))
    t = np.arange(0, 0.008, 1e-3)
    given = np.sin(90 * t)
    ours = simulate(system, t, given, squeeze=squeeze)
    theirs = ct.input_output_response(
        system, t, given, squeeze=squeeze, solve_ivp_method="LSODA", solve_ivp_kwargs=TIGHT
    )
    _same(ours, theirs)
    _same(ours(squeeze=False, transpose=True), theirs(squeeze=False, transpose=True))
    (t1, y1), (t2, y2) = ours, theirs
    np.testing.assert_array_equal(t1, t2)
    assert y1.shape == y2.shape and len(ours(return_x=True)) == 3
    assert ours(return_x=True)[2].shape == theirs(return_x=True)[2].shape
    labels = ("output_labels", "input_labels", "state_labels", "sysname", "title")
    for key in ("ntraces", "issiso", *labels):
        assert getattr(ours, key) == getattr(theirs, key)
    label = system.output_labels[0]
    if name == "loop" or squeeze is False:
        np.testing.assert_array_equal(ours.outputs[label], ours.outputs[0])
    for one, other in zip(_lines(ours), _lines(theirs), strict=True):
        assert one.shape == other.shape
    given[:] = 7.0
    assert np.max(ours.inputs) <= 1.0


def _same(ours, theirs) -> None:
    for key in ("time", "outputs", "states", "inputs"):
        one, other = np.asarray(getattr(ours, key)), np.asarray(getattr(theirs, key))
        assert one.shape == other.shape
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-5 * np.max(np.abs(other)))


def _lines(response) -> list[np.ndarray]:
    """What plot() draws."""
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    drawn = response.plot()
    found = [line.get_xydata() for ax in np.ravel(drawn.axes) for line in ax.get_lines()]
    plt.close("all")
    return found


def test_initial_states_come_in_the_parts_that_python_control_takes():
    """A vector and a matrix, row by row; a last 0 stands for all that follow."""
    system = ct.rss(6, 2, 1, strictly_proper=True)
    system.name = "six"
    t, covariance = np.linspace(0, 1, 5), np.array([[3.0, 1.0], [2.0, 4.0]])
    parts = lg.simulate(system, t, 0.0, [[1.0, 2.0], covariance])
    flat = lg.simulate(system, t, 0.0, [1.0, 2.0, 3.0, 1.0, 2.0, 4.0])
    np.testing.assert_array_equal(parts.states, flat.states)
    short = lg.simulate(system, t, 0.0, [np.array([1.0, 2.0]), 0])
    np.testing.assert_array_equal(short.states[:, 0], [1, 2, 0, 0, 0, 0])
    with pytest.raises(lg.InputError, match="has 6 states, x0 has 3"):
        lg.simulate(system, t, 0.0, [np.array([1.0, 2.0]), 1])
