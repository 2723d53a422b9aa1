"""Limit, anti-windup, notch, current lag and dead time against their definitions."""

import pickle
from fractions import Fraction

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine.runtime import adaptive_run
from lugrectl.simulation.response import simulate
from lugrectl.simulation.sampled_block import sampled

from ..cases.transfer import response, s, same

T = np.arange(0, 0.5, 1e-3)


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    """Short runs: plain Python is faster than compiling."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)


def static(name, inputs, output, function):
    return ct.nlsys(None, function, inputs=inputs, outputs=[output], name=name)


# Definitions.


@pytest.mark.parametrize("depth", [0.0, 0.1, 1.0])
def test_the_notch_is_its_transfer_function(depth):
    W = 2 * np.pi * 50
    expected = (s**2 + 2 * depth * 0.3 * W * s + W**2) / (s**2 + 2 * 0.3 * W * s + W**2)
    same(lg.notch(50.0, 0.3, depth), expected)
    made = lg.notch(50.0, 0.3, depth)
    middle = ct.linearize(made, [0.0, 0.0], [0.0])(1j * W)
    assert abs(complex(middle)) == pytest.approx(depth, abs=1e-9)


def test_current_lag_and_dead_time_are_the_effects_of_the_catalogue():
    same(lg.current_lag(2e-3), 1 / (2e-3 * s + 1))
    late = 1e-3
    same(lg.dead_time(late), 1 - 12 * s * late / (s**2 * late**2 + 6 * s * late + 12))
    slow = np.exp(-1j * 83.0 * late)
    assert response(lg.dead_time(late))[4] == pytest.approx(slow, rel=1e-6)
    effect = lg.effect("input_delay", delay=late, inputs=["u_cmd"])
    x, u = [0.3, -0.2], [0.7]
    assert np.array_equal(lg.dead_time(late).dynamics(0, x, u), effect.dynamics(0, x, u))


@pytest.mark.parametrize("make", [lg.current_lag, lg.dead_time, lambda T: lg.dead_time(T, 1e-3)])
def test_no_delay_passes_the_command(make):
    made = make(0.0)
    assert made.output(0.0, np.zeros(made.nstates), [0.7]) == pytest.approx(0.7)


@pytest.mark.parametrize("late", [0.5, Fraction(3, 4), np.float64(2.0)])
def test_a_long_dead_time_is_that_of_delayed(late):
    """In a loop about an integrator, and exact in a simulation."""
    block = lg.dead_time(late)
    loop = ct.interconnect(
        [ct.tf(ct.tf([0.6], [1.0, 0.0]), inputs="e", outputs="u_cmd", name="plant"),
         block, ct.summing_junction(["r", "-u"], "e")],
        inputs="r", outputs="u", params={},
    )  # fmt: skip
    seen = lg.stability_check(lg.linearize(loop, input="r", output="u").open_loop)
    same_loop = lg.stability_check(lg.delayed(ct.tf([0.6], [1.0, 0.0]), late))
    assert seen.gain_margin == pytest.approx(same_loop.gain_margin, rel=1e-12)
    t = np.linspace(0.0, 4.0, 401)
    run = simulate(block, t, np.sin(t))
    assert run.outputs == pytest.approx(np.where(t >= late, np.sin(t - float(late)), 0.0), abs=1e-4)


@pytest.mark.parametrize(("delay", "expected"), [(0.2, [0, 0, 1, 2]), (0.15, [0, 0.5, 1.5, 2.5])])
def test_the_sampled_dead_time_is_exact(delay, expected):
    made = lg.dead_time(delay, 0.1)
    t = 0.1 * np.arange(4)
    u = np.array([1.0, 2.0, 3.0, 4.0])
    expected = np.array(expected)
    if delay == 0.2:
        expected = np.array([0.0, 0.0, 1.0, 2.0])
    assert ct.input_output_response(made, t, u).outputs == pytest.approx(expected)
    assert simulate(made, t, u).outputs == pytest.approx(expected)
    again = pickle.loads(pickle.dumps(made))
    assert simulate(again, t, u).outputs == pytest.approx(expected)


def test_the_limiter_says_what_it_cuts_off():
    for u, limited in ((3.0, 2.0), (-3.0, -2.0), (0.4, 0.4)):
        assert lg.limiter(2.0).output(0, [], [u]) == pytest.approx([limited, limited - u])


def test_the_proportional_controller_has_the_sign_of_all_controllers():
    assert lg.proportional(20.0).output(0, [], [0.1]) == pytest.approx(-2.0)
    assert lg.proportional(20.0, 1.5).output(0, [], [0.1]) == pytest.approx(-1.5)


# Limits with back-calculation.


@pytest.mark.parametrize("tracking", [None, 0.05])
def test_back_calculation_pulls_the_integral_by_the_excess(tracking):
    time = 1.6 / 0.16 if tracking is None else tracking
    made = lg.pi(1.6, 0.16, limit=1.0, tracking=tracking)
    q, e = 2.0, -0.9
    free = 1.6 * 0.9 + 0.16 * q
    assert made.output(0, [q], [e]) == pytest.approx(1.0)
    assert made.dynamics(0, [q], [e]) == pytest.approx(0.9 + (1.0 - free) / (0.16 * time))


def test_within_the_limit_nothing_changes():
    for plain, held in (
        (lg.pi(1.6, 0.16), lg.pi(1.6, 0.16, limit=50.0)),
        (lg.pid(15, 1.5, 0.3, 0.2), lg.pid(15, 1.5, 0.3, 0.2, limit=50.0)),
    ):
        x, u = [0.7], [-0.4, 0.2][: plain.ninputs]
        assert plain.output(0, x, u) == held.output(0, x, u)
        assert plain.dynamics(0, x, u) == held.dynamics(0, x, u)


def test_at_the_limit_the_integral_settles_at_the_limit():
    """With the default time: ki q -> limit, and the output leaves it when e changes sign."""
    made = lg.pi(2.0, 10.0, limit=1.5)
    q = simulate(made, np.arange(0, 3.0, 1e-2), -5.0).states[0]
    assert 10.0 * q[-1] == pytest.approx(1.5, rel=1e-4)
    wound = simulate(lg.pi(2.0, 10.0, limit=1.5, tracking=np.inf), np.arange(0, 3.0, 1e-2), -5.0)
    assert 10.0 * wound.states[0][-1] > 100.0


@pytest.mark.parametrize("kind", ["pi", "pid"])
def test_a_limit_elsewhere_gives_the_same_as_its_own(kind):
    """The tracked controller with a limiter behind it, wired by names, in both simulations."""
    given = {"e": -2 * np.cos(9 * T), "w": np.sin(5 * T)}
    make = {"pi": lambda **k: lg.pi(2.0, 30.0, **k), "pid": lambda **k: lg.pid(2, 30, 0.2, **k)}
    inputs = ["e", "w"][: 1 + (kind == "pid")]
    u = [given[k] for k in inputs]
    own = make[kind](limit=1.5, tracking=0.02)
    beside = [make[kind](tracking=0.02, outputs=["u_cmd"]), lg.limiter(1.5)]
    beside = ct.interconnect(beside, inputs=inputs, outputs=["u"], check_unused=False)
    one, other = (simulate(m, T, np.array(u), rtol=1e-9).outputs for m in (own, beside))
    assert other == pytest.approx(one, abs=1e-6)
    options = {"solve_ivp_method": "LSODA", "solve_ivp_kwargs": {"rtol": 1e-9, "atol": 1e-12}}
    theirs = ct.input_output_response(beside, T[:150], np.array(u)[:, :150], **options).outputs
    assert np.ravel(theirs) == pytest.approx(np.ravel(one)[:150], abs=1e-6)


def test_no_limit_on_the_integral_is_a_clip_behind_the_controller():
    e = -2 * np.cos(9 * T)
    clip = static("clip", ["u_cmd"], "u", lambda t, x, u, params: np.clip(u[0], -1.5, 1.5))
    beside = ct.interconnect(
        [lg.pi(2.0, 30.0, outputs=["u_cmd"]), clip], inputs=["e"], outputs=["u"]
    )
    own = lg.pi(2.0, 30.0, limit=1.5, tracking=np.inf)
    one, other = (simulate(m, T, e, rtol=1e-9).outputs for m in (own, beside))
    assert other == pytest.approx(one, abs=1e-8)


def test_a_limited_controller_runs_at_a_sample_rate():
    """With its own limit in substeps; with a limiter beside it exactly, one sample late."""
    dt = 1e-3
    e = -2 * np.cos(9 * T)
    exact = simulate(lg.pi(2.0, 30.0, limit=1.5, tracking=0.02), T, e, rtol=1e-9).outputs
    own = sampled(lg.pi(2.0, 30.0, limit=1.5, tracking=0.02), dt)
    assert simulate(own, T, e).outputs == pytest.approx(exact, abs=1e-4)
    beside = [sampled(lg.pi(2.0, 30.0, tracking=0.02, outputs=["u_cmd"]), dt), lg.limiter(1.5)]
    found = simulate(beside, T, e)
    u = found.outputs[list(found.output_labels).index("u")]
    assert u == pytest.approx(exact, abs=0.1) and np.abs(u).max() == 1.5


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: lg.pi(limit=-1.0), "limit = -1 lies outside"),
        (lambda: lg.pi(limit="much"), "limit must be a number"),
        (lambda: lg.pi(0.0, 1.0, limit=1.0), "give tracking in s"),
        (lambda: lg.pi(tracking=0.0), "tracking = 0 must be above 0 s"),
        (lambda: lg.limiter(-2.0), "limit"),
        (lambda: lg.notch(0.0), "frequency = 0 must be above 0 Hz"),
        (lambda: lg.notch(10.0, depth=2.0), "depth"),
        (lambda: lg.dead_time(-1.0), "delay is -1 s, but a dead time cannot be negative"),
        (lambda: lg.dead_time(1.0, 1e-5), "10000 samples"),
        (lambda: lg.dead_time(0.1, -1.0), "dt must be a positive number"),
        (lambda: lg.current_lag(-1.0), "time_constant"),
    ],
)
def test_wrong_values_are_one_sentence(call, said):
    with pytest.raises(lg.InputError, match=said) as raised:
        call()
    assert "\n" not in str(raised.value) and str(raised.value).endswith(".")
