"""Lists of continuous and sampled blocks through simulate(): closed forms and other routes."""

from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest
from scipy.linalg import expm

import lugrectl as lg
from lugrectl.core.errors import Diverged
from lugrectl.engine import AlgebraicLoop, adaptive_run, memo
from lugrectl.simulation.response import simulate

from ..cases.own import row, static, user_block
from ..cases.wired import LOW, OUTPUTS
from ..conftest import there

pytestmark = pytest.mark.usefixtures("interpreted")

P, DT = lg.table1(), 1e-3
A, B = np.array([[0.0, 1.0], [-9.0, -0.6]]), np.array([[0.0], [4.0]])


def swing():
    return ct.ss(A, B, np.eye(2), 0, inputs=["u"], outputs=["y", "v"], name="swing")


def law(function, inputs, output, dt, name):
    """A block that answers at once, at its ticks where dt > 0."""
    return static(lambda t, x, u, p: function(*u), inputs, output, name, dt=dt)


def summed(dt, source, target, name):
    """target[k] = sum of source over the ticks before k."""
    return user_block(
        lambda t, x, u, p: x + u, lambda t, x, u, p: x, [source], [target], ["sum"], name, dt=dt
    )


def untraceable(function):
    """The same with a branch on its first signal."""
    return lambda *u: function(*u) if u[0] > -math.inf else 0.0


def by_matrices(t, periods, x):
    """The swing under u = r - 0.5 y sampled at one period and 0.2 v at another: exact."""
    u1, u2, out = 0.0, 0.0, []
    ticks = {round(k * h / 1e-4) for h in periods for k in range(int(t[-1] / h) + 1)}
    places = {round(time / 1e-4) for time in t}
    steps = sorted(ticks | places)
    for k, now in enumerate(steps):
        if now % round(periods[0] / 1e-4) == 0:
            u1 = 1.0 - 0.5 * x[0]
        if now % round(periods[1] / 1e-4) == 0:
            u2 = -0.2 * x[1]
        if now in places:
            out.append(x)
        if k + 1 < len(steps):
            big = np.zeros((3, 3))
            big[:2, :2], big[:2, 2:] = A, B
            step = expm(big * 1e-4 * (steps[k + 1] - now))
            x = (step @ [*x, u1 + u2])[:2]
    assert len(out) == len(t)
    return np.array(out).T


@pytest.mark.parametrize("traced", [True, False])
@pytest.mark.parametrize("periods", [(0.1, 0.1), (0.1, 0.03), (0.02, 0.05)])
def test_two_sample_times_against_matrix_exponentials(traced, periods):
    """Also at times between ticks; the two controllers' outputs u add up."""
    wrap = (lambda f: f) if traced else untraceable
    blocks = [
        swing(),
        law(wrap(lambda y, r: r - 0.5 * y), ["y", "r"], "u", periods[0], "slow"),
        law(wrap(lambda v: -0.2 * v), ["v"], "u", periods[1], "quick"),
    ]
    t = np.array([0.0, 0.0137, 0.02, 0.1, 0.1501, 0.35, 0.9, 1.2, 1.2345, 2.0])
    resp = simulate(blocks, t, {"r": 1.0}, [0.3, -0.2], rtol=1e-9)
    exact = by_matrices(t, periods, np.array([0.3, -0.2]))
    np.testing.assert_allclose(resp.states, exact, atol=1e-7)
    assert resp.input_labels == ["r"] and resp.output_labels == ["y", "v", "u"]
    assert resp.state_labels == [f"swing_{k}" for k in swing().state_labels]


def test_compiled_code_says_the_same(monkeypatch):
    made_by = there("c")
    blocks = [swing(), law(lambda y, r: np.tanh(r - y), ["y", "r"], "u", 0.1, "slow")]
    t = np.linspace(0, 3, 50)
    plain = simulate(blocks, t, np.sin(t))
    monkeypatch.setattr(adaptive_run, "compiler", lambda: made_by)
    monkeypatch.setattr(adaptive_run, "FEW", 0)
    monkeypatch.setattr(memo, "_traced", {})
    compiled = simulate(blocks, t, np.sin(t))
    np.testing.assert_allclose(compiled.outputs, plain.outputs, rtol=1e-9, atol=1e-12)


def test_continuous_blocks_alone_are_an_interconnection():
    blocks = [lg.plant(P), lg.pi(1.6, 0.16), lg.error()]
    t = np.arange(0, 0.05, 1e-3)
    r = np.sin(60 * t)
    whole = ct.interconnect(blocks, inputs=["r"], outputs=["w", "u"], params={}, check_unused=False)
    blocks[1] = lg.pi(1.6, 0.16, name="u")  # a block may be called like a signal
    for inputs in ({"r": r}, {"r": r, "d": 0.0}, [0 * t, r]):
        listed = simulate(blocks, t, inputs)
        assert listed.input_labels == ["d", "r"]
        np.testing.assert_allclose(row(listed, "w"), simulate(whole, t, r).outputs[0], atol=1e-9)


def test_a_drive_list_is_the_sampled_simulation():
    """Statics act at every instant; at the samples that is what the drive computes."""
    drive = [
        lg.error(),
        lg.compensation(),
        lg.sampled(lg.pi(1.6, 0.16), DT),
        lg.sampled(lg.proposed_observer(P), DT),
    ]
    t = DT * np.arange(30)
    r = 0.1 * np.sin(20 * t)
    one = simulate([lg.plant(P), *drive], t, {"r": r})
    two = lg.simulate_sampled(lg.plant(P), drive, t, r)
    for name in ("w", "u", "Fhat", "e"):
        np.testing.assert_allclose(row(one, name), row(two, name), rtol=1e-9, atol=1e-12)


def test_outputs_hold_and_states_wait_for_the_tick():
    blocks = [summed(0.3, "a", "b", "first"), law(lambda b: 10.0 * b, ["b"], "c", None, "static")]
    t = np.array([0.0, 0.1, 0.3, 0.5, 0.6, 0.7])
    resp = simulate(blocks, t, 1.0)
    assert row(resp, "b") == pytest.approx([0, 0, 1, 1, 2, 2])
    assert row(resp, "c") == pytest.approx([0, 0, 10, 10, 20, 20])
    assert resp.states[0] == pytest.approx([0, 1, 1, 2, 2, 3])


def test_inputs_are_linear_or_held_between_their_samples():
    block, t = law(lambda a: a, ["a"], "b", 0.1, "reader"), np.array([0.0, 0.2, 0.4])
    fine = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    linear = simulate([block, summed(0.1, "b", "s", "sum")], t, t)
    holding = simulate([block, summed(0.1, "b", "s", "sum")], t, t, hold=True)
    assert row(linear, "s")[-1] == pytest.approx(fine[:-1].sum())
    assert row(holding, "s")[-1] == pytest.approx(0.0 + 0.0 + 0.2 + 0.2)


def test_a_start_between_ticks_answers_the_initial_state():
    resp = simulate([summed(0.3, "a", "b", "first")], [0.1, 0.2, 0.3, 0.4, 0.65], 1.0, 5.0)
    assert np.ravel(resp.outputs) == pytest.approx([5, 5, 5, 5, 6])


def test_the_unit_true_takes_the_others_sample_time():
    blocks = [summed(True, "a", "b", "one"), summed(0.5, "b", "c", "two")]
    resp = simulate(blocks, [0.0, 0.5, 1.0, 1.5], 1.0)
    assert row(resp, "c") == pytest.approx([0, 0, 1, 3])
    with pytest.raises(lg.InputError, match="one has dt=True"):
        simulate(blocks[:1], [0.0, 1.0], 1.0)


def test_parameters_stay_arguments(monkeypatch):
    gain = static(
        lambda t, x, u, p: p["gain.k"] * u[0], ["y"], ["u"], "gain", dt=0.1, **{"gain.k": -1.0}
    )
    blocks, t = [swing(), gain], np.linspace(0, 1, 11)
    simulate(blocks, t, x0=[1.0, 0.0])
    monkeypatch.setattr(adaptive_run, "run_code", None)
    other = simulate(blocks, t, x0=[1.0, 0.0], params={"gain.k": 0.0})
    exact = [(expm(A * s) @ [1.0, 0.0])[0] for s in t]
    np.testing.assert_allclose(row(other, "y"), exact, atol=1e-6)


@pytest.mark.parametrize("wrap", [lambda f: f, untraceable])
@pytest.mark.parametrize("dt", [0.1, None])
def test_a_loop_through_a_tick_that_is_not_linear_names_its_blocks(wrap, dt):
    blocks = [
        swing(),
        law(wrap(lambda b: 0.5 * b * b + 1.0), ["b"], "a", 0.1, "one"),
        law(lambda a: 0.5 * a, ["a"], "b", dt, "two"),
        law(lambda a: a, ["a"], "u", 0.1, "bystander"),
    ]
    with pytest.raises(AlgebraicLoop, match="through one, two;"):
        simulate(blocks, [0.0, 1.0])


@pytest.mark.parametrize("wrap", [lambda f: f, untraceable])
def test_what_is_no_number_names_block_signal_and_time(wrap):
    root = law(wrap(lambda y: np.sqrt(y)), ["y"], "u", 0.1, "root")
    down = user_block(lambda t, x, u, p: -1.0 + 0 * u, None, ["u"], ["y"], 1, "down")
    with pytest.raises(Diverged, match="output u of block root is nan at t = 0.6 s"):
        simulate([down, root], [0.0, 1.0], x0=0.55)


def test_a_continuous_block_with_a_branch_goes_to_lsoda():
    odd = user_block(
        lambda t, x, u, p: u[0] - x[0] if x[0] > -9 else 0.0, None, ["u"], ["y"], 1, "odd"
    )
    hold = law(lambda r: r, ["r"], "u", 0.1, "hold")
    t = np.linspace(0, 1, 11)
    with pytest.warns(RuntimeWarning, match=r"block odd.*line \d+.*LSODA") as said:
        y = row(simulate([odd, hold], t, t, rtol=1e-8), "y")
    assert len(said) == 1
    x, exact = 0.0, []
    for held_at in t:
        exact.append(x)
        x = held_at + (x - held_at) * np.exp(-0.1)
    np.testing.assert_allclose(y, exact, atol=1e-6)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda t: simulate([swing(), swing()], t), "two blocks are called swing"),
        (lambda t: simulate([summed(1e-9, "a", "b", "s")], t), "updated 1e.09 times"),
        (lambda t: simulate([], t), "empty"),
        (lambda t: simulate([swing(), 3.0], t), "not 3.0"),
        (lambda t: simulate([swing()], t, {"y": 1.0}), "there is no external input 'y'"),
        (lambda t: simulate([swing()], t, {"u": np.ones(3)}), "input u must be"),
        (lambda t: simulate([summed(0.1, "a", "b", "s")], t, np.ones(3)), "needs inputs"),
        (
            lambda t: simulate([summed(0.1, "a", "b", "s")], t, params={"s.k": 1.0}),
            "no block reads the parameter 's.k'",
        ),
    ],
)
def test_what_does_not_fit_is_said(call, said):
    with pytest.raises(lg.InputError, match=said):
        call(np.linspace(0, 1, 6))


def test_own_loop_with_prefilter_and_feedforward_equals_the_ready_one():
    parts = [
        lg.plant(P),
        lg.proposed_observer(LOW),
        lg.pi(),
        lg.prefilter(kind="velocity"),
        lg.error(),
        lg.feedforward(P),
        lg.compensation(),
    ]
    own = ct.interconnect(parts, inputs=["r_cmd", "d"], outputs=OUTPUTS, check_unused=False)
    ready = lg.velocity_loop(
        P,
        "proposed",
        observer_parameters=LOW,
        prefilter=True,
        feedforward=True,
        load=True,
    )
    rng = np.random.default_rng(1)
    for x, u in zip(rng.normal(size=(20, 7)), rng.normal(size=(20, 2)), strict=True):
        x = x * [1, 0.1, 1e-3, 1e-3, 0.1, 1, 1]
        assert own.dynamics(0, x, u) == pytest.approx(ready.dynamics(0, x, u), rel=1e-12)
        assert own.output(0, x, u) == pytest.approx(ready.output(0, x, u), rel=1e-12)
