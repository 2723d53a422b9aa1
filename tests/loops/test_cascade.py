"""The cascade that drives have: its transfer function, its limits, its load."""

import pickle

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import adaptive_run
from lugrectl.simulation.response import simulate

P = lg.table1()
KV, KP, KI = 20.0, 1.6, 16.0
GEARED = lg.Model.of(P).with_effect(
    "elastic_coupling", {"load_inertia": 0.002, "stiffness": 40.0, "damping": 0.02}
)


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    """Short runs: plain Python is faster than compiling."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)


def rows(response, *labels):
    known = list(response.output_labels)
    return np.array([response.outputs[known.index(k)] for k in labels])


def overshoot(loop, label="theta", reference=2.0):
    t = np.arange(0, 1.0, 2e-3)
    r = np.full((loop.ninputs, len(t)), 0.0)
    r[0] = reference
    found = simulate(loop, t, r)
    return float(rows(found, label).max()) / reference - 1.0


def test_wind_up_with_and_without_back_calculation():
    """2 rad with 0.6 N m, of which friction takes half: 40 % too far, or not at all."""
    wound = overshoot(lg.cascade_loop(P, limit=0.6, tracking=np.inf))
    held = overshoot(lg.cascade_loop(P, limit=0.6))
    assert wound > 0.4 and held < 0.01


@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop])
def test_the_other_loops_take_a_limit(make):
    label = "w" if make is lg.velocity_loop else "theta"
    gains = {"kp": 1.6, "ki": 16.0} if make is lg.velocity_loop else {"kp": 15, "ki": 40, "kd": 0.5}
    loops = [make(P, limit=0.5, tracking=T, **gains) for T in (None, np.inf)]
    held, wound = (overshoot(loop, label, 5.0 if label == "w" else 2.0) for loop in loops)
    assert wound > 2 * max(held, 0.02)
    far = make(P, "proposed", limit=0.5, **gains, prefilter=True, feedforward=True)
    inputs = np.zeros(far.ninputs)
    inputs[0] = 1e3
    moved = [1e3 if "prefilter" in k else 0.0 for k in far.state_labels]
    out = dict(zip(far.output_labels, far.output(0, moved, inputs), strict=True))
    assert out["u"] == 0.5


@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop, lg.cascade_loop])
def test_the_observer_sees_the_limited_torque(make):
    """J dwhat/dt = u - Fhat + K2 (w - what) with u at its limit, at rest: limit/J."""
    loop = make(P, "proposed", limit=0.5)
    rates = dict(
        zip(loop.state_labels, loop.dynamics(0, np.zeros(loop.nstates), [100.0]), strict=True)
    )
    assert rates["proposed_observer_what"] == pytest.approx(0.5 / P.J)
    assert rates["plant_w"] == pytest.approx(0.5 / P.J)


@pytest.mark.parametrize("name", ["slotine_li", "repetitive_control"])
@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop])
def test_a_limit_stands_behind_a_controller_by_name(make, name):
    loop = make(P, "temperature", controller=name, limit=0.5)
    inputs = [100.0] * loop.ninputs
    rates = loop.dynamics(0, np.zeros(loop.nstates), inputs)
    assert rates[loop.state_labels.index("plant_w")] == pytest.approx(0.5 / P.J)
    out = dict(zip(loop.output_labels, loop.output(0, np.zeros(loop.nstates), inputs), strict=True))
    assert out["u"] == 0.5
    with pytest.raises(lg.InputError, match=f"leave it out with {name}"):
        make(P, controller=name, limit=0.5, tracking=0.1)


def test_an_observer_on_the_sliding_error_finds_it_in_the_cascade():
    """s = (w - dr) + 20 (theta - r), with the position of the load where that is measured."""
    for model, feedback in ((P, "motor"), (GEARED, "load")):
        loop = lg.cascade_loop(model, "lyapunov", feedback=feedback)
        assert loop.input_labels == ["r", "dr"]
        x = 0.01 * np.arange(1.0, loop.nstates + 1)
        x[loop.state_labels.index("plant_w")] = 0.0
        outputs = loop.output(0, x, [0.1, 0.0])
        theta = outputs[loop.output_labels.index("theta" if model is P else "theta_load")]
        rate = loop.dynamics(0, x, [0.1, 0.0])[loop.state_labels.index("lyapunov_observer_zhat")]
        assert rate == pytest.approx(-0.35 * 20 * (theta - 0.1))


def test_signals_of_the_cascade():
    usual = ["theta", "w", "F", "Fhat", "u", "e", "w_ref"]
    assert lg.cascade_loop(P).output_labels == usual
    loop = lg.cascade_loop(P, "natural", lag=1e-3, notch=80, feedforward=True, load=True)
    assert loop.input_labels == ["r", "dr", "ddr", "d"]
    assert loop.output_labels == [*usual, "u_motor"]
    names = [block.name for block in loop.syslist]
    assert {"notch", "current_lag", "natural_observer", "pi", "proportional"} <= {*names}
    assert lg.cascade_loop(GEARED).output_labels == [*usual, "theta_load", "w_load"]
    assert pickle.loads(pickle.dumps(loop)).output_labels == loop.output_labels


def test_the_cascade_without_limits_is_its_transfer_function():
    s = ct.tf("s")
    loop = lg.cascade_loop(P, "natural", kv=KV, kp=KP, ki=KI, notch=(90.0, 0.5, 0.2), lag=1e-3)
    W = 2 * np.pi * 90
    shape = (s**2 + 2 * 0.2 * 0.5 * W * s + W**2) / (s**2 + 2 * 0.5 * W * s + W**2)
    linear = ct.linearize(loop, np.zeros(loop.nstates), [0.0])
    F = 260 + 0.618 * s  # the bristles at rest: sigma0 + (sigma1 + Fv) s, per position
    G = 1 / (P.J * s**2 + F - F * shape / (1e-3 * s + 1))
    C = (KP + KI / s) * shape / (1e-3 * s + 1)
    closed = C * KV * G / (1 + C * G * (KV + s))
    for w in (3.0, 20.0, 200.0):
        assert linear(1j * w)[0, 0] == pytest.approx(closed(1j * w), rel=1e-4)


# The load's side.


def test_a_loop_on_the_second_encoder_places_the_load():
    """A constant load torque on the motor's side is no matter; the twist is."""
    t = np.arange(0, 1.0, 1e-3)
    geared = GEARED.with_effect("gravity", {"amplitude": 0.1, "phase": 0.0})
    ends = {}
    for feedback in ("motor", "load"):
        loop = lg.cascade_loop(geared, "natural", kv=5.0, ki=2.0, feedback=feedback)
        ends[feedback] = rows(simulate(loop, t, 1.0), "e", "theta", "theta_load")
    e, theta, there = ends["load"]
    assert e == pytest.approx(there - 1.0) and np.abs(e - (theta - 1.0)).max() > 1e-3
    e, theta, _ = ends["motor"]
    assert e == pytest.approx(theta - 1.0)


# Dead time in the loop.


def test_dead_time_takes_the_phase_margin():
    """The velocity loop crosses over near kp/J = 727 1/s: pi/2/727 = 2.2 ms are too many."""
    found = {}
    for delay in (0.0, 1e-3, 3e-3):
        loop = lg.cascade_loop(P, "natural", kv=5.0, ki=0.0, delay=delay)
        moving = np.zeros(loop.nstates)
        moving[list(loop.state_labels).index("plant_w")] = 5.0
        poles = np.linalg.eigvals(ct.linearize(loop, moving, [0.0]).A)
        found[delay] = poles.real.max()
    assert found[0.0] < 1e-6 and found[1e-3] < 1e-6 < 10 < found[3e-3]
