"""Controllers and what stands in the path of their torque, against their definitions."""

import pickle
from fractions import Fraction

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.block import members
from lugrectl.blocks.controllers import dead_times
from lugrectl.engine import adaptive_run

from ..cases.observed import P
from ..cases.observed import relaxation as rate
from ..cases.transfer import s, same
from ..cases.wired import joined, simulate

few, deflections = st.floats(-1.0, 1.0), st.floats(-2e-3, 2e-3)
gains = st.floats(0.01, 10.0)
T = np.arange(0, 0.5, 1e-3)


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    """Short runs: plain Python is faster than compiling."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)


def late(T):
    """The Pade form of a dead time."""
    return 1 - 12 * s * T / (s**2 * T**2 + 6 * s * T + 12)


def notched(depth, W=2 * np.pi * 50):
    return (s**2 + 2 * depth * 0.3 * W * s + W**2) / (s**2 + 2 * 0.3 * W * s + W**2)


TRANSFERS = {
    "pi": (lg.pi(1.6, 0.16), -(1.6 + 0.16 / s)),
    **{f"pid, {t}": (lg.pid(15.0, 1.55, 0.3, t), -(15.0 + 1.55 / s)) for t in (None, 0, 0.0)},
    **{
        f"pid, {t}": (lg.pid(15.0, 1.55, 0.3, t), -(15.0 + 1.55 / (t * s + 1)))
        for t in (1e-3, 0.2, 30.0)
    },
    "compensation": (lg.compensation(), ct.tf(1, 1)),
    "feedforward": (lg.feedforward(P), ct.tf(P.J, 1)),
    "feedforward of a model": (lg.feedforward(lg.Model.of(P), "position"), ct.tf(P.J, 1)),
    **{f"prefilter, {p}": (lg.prefilter(p), p / (s + p)) for p in (2.0, 0.3, 50.0)},
    "prefilter with dr": (lg.prefilter(3.0, "velocity"), 3 / (s + 3)),
    "prefilter with ddr": (lg.prefilter(3.0, "position"), 3 / (s + 3)),
    "prefilter of a motion": (lg.prefilter(3.0, "motion"), 3 / (s + 3)),
    **{f"notch, {d}": (lg.notch(50.0, 0.3, d), notched(d)) for d in (0.0, 0.1, 1.0)},
    "current lag": (lg.current_lag(2e-3), 1 / (2e-3 * s + 1)),
    "dead time": (lg.dead_time(1e-3), late(1e-3)),
}


@pytest.mark.parametrize(("block", "transfer"), TRANSFERS.values(), ids=TRANSFERS)
def test_a_block_is_its_transfer_function(block, transfer):
    same(block, transfer)


@pytest.mark.parametrize("tau", [None, 0.2])
def test_derivative_action_is_on_the_velocity(tau):
    same(lg.pid(15.0, 1.55, 0.3, tau), ct.tf(-0.3, 1), input=1)


def test_prefilters_put_out_the_derivatives_of_their_reference():
    velocity, position, motion = (
        lg.prefilter(3.0, kind) for kind in ("velocity", "position", "motion")
    )
    assert velocity.output_labels == ["r", "dr"] and motion.output_labels == ["r", "dr", "ddr"]
    assert (position.input_labels, position.output_labels) == (["r_cmd", "ddr_cmd"], ["r", "ddr"])
    for block in (velocity, motion):
        same(block, 3 * s / (s + 3), output=1)
    same(position, 3 / (s + 3), output=1, input=1)
    same(position, ct.tf(0, 1), output=1, input=0)
    same(motion, 3 * s / (s + 3) - 3 * s / (s + 3) + ct.tf(-9, 1) * s / (s + 3), output=2)
    same(motion, 3 / ct.tf(1, 1), output=2, input=1)


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
    run = lg.simulate(block, t, np.sin(t))
    assert run.outputs == pytest.approx(np.where(t >= late, np.sin(t - float(late)), 0.0), abs=1e-4)


@pytest.mark.parametrize(("delay", "expected"), [(0.2, [0, 0, 1, 2]), (0.15, [0, 0.5, 1.5, 2.5])])
def test_the_sampled_dead_time_is_exact(delay, expected):
    made, t = lg.dead_time(delay, 0.1), 0.1 * np.arange(4)
    u = np.array([1.0, 2.0, 3.0, 4.0])
    assert ct.input_output_response(made, t, u).outputs == pytest.approx(np.array(expected))
    for block in (made, pickle.loads(pickle.dumps(made))):
        assert lg.simulate(block, t, u).outputs == pytest.approx(np.array(expected))


LATE = lg.Model.of(
    J=0.0022, friction="viscous", Fv=0.018, effects=[{"name": "input_delay", "delay": 5e-3}]
)


def test_each_dead_time_is_found_with_its_states():
    loop = lg.cascade_loop(LATE, kv=20.0, delay=2e-3, lag=1e-3)
    parts = [lg.prefilter(2.0), loop]
    outer = joined(parts, ["r_cmd"], ["w"])
    for system in (loop, outer):
        found = [*dead_times(system, {"plant.input_delay.delay": 1e-3})]
        assert sorted(one.seconds for one in found) == [1e-3, 2e-3]
        for one in found:
            first, second = system.state_labels[one.place : one.place + 2]
            assert first.endswith("_p1") and second.endswith("_p2") and one.block in first


@pytest.mark.parametrize(
    ("block", "given", "expected"),
    [
        (lg.limiter(2.0), 3.0, [2.0, -1.0]),
        (lg.limiter(2.0), -3.0, [-2.0, 1.0]),
        (lg.limiter(2.0), 0.4, [0.4, 0.0]),
        (lg.proportional(20.0), 0.1, [-2.0]),  # the sign of all controllers
        (lg.proportional(20.0, 1.5), 0.1, [-1.5]),
    ],
)
def test_a_limit_cuts_off_what_is_beyond_it(block, given, expected):
    assert block.output(0, [], [given]) == pytest.approx(expected)


@pytest.mark.parametrize("tracking", [None, 0.05])
def test_back_calculation_pulls_the_integral_by_the_excess(tracking):
    time = 1.6 / 0.16 if tracking is None else tracking
    made = lg.pi(1.6, 0.16, limit=1.0, tracking=tracking)
    q, e = 2.0, -0.9
    free = 1.6 * 0.9 + 0.16 * q
    assert made.output(0, [q], [e]) == pytest.approx(1.0)
    assert made.dynamics(0, [q], [e]) == pytest.approx(0.9 + (1.0 - free) / (0.16 * time))


def test_a_limit_elsewhere_gives_the_same_as_its_own():
    """The tracked controller with a limiter behind it, wired by names, in both simulations."""
    u = [-2 * np.cos(9 * T), np.sin(5 * T)]
    own = lg.pid(2, 30, 0.2, limit=1.5, tracking=0.02)
    tracked = lg.pid(2, 30, 0.2, tracking=0.02, outputs=["u_cmd"])
    beside = joined([tracked, lg.limiter(1.5)], ["e", "w"], ["u"])
    one, other = (lg.simulate(m, T, np.array(u), rtol=1e-9).outputs for m in (own, beside))
    assert other == pytest.approx(one, abs=1e-6)
    theirs = simulate(beside, T[:60], np.array(u)[:, :60], rtol=1e-8, atol=1e-11).outputs
    assert np.ravel(theirs) == pytest.approx(np.ravel(one)[:60], abs=1e-6)


@given(few, few, few, few, few, st.floats(0.0, 50.0))
def test_the_sliding_error_and_its_rate(theta, w, r, dr, ddr, lam):
    s, ar = lg.sliding_error(lam).output(0.0, [], [theta, w, r, dr, ddr])
    assert s == pytest.approx((w - dr) + lam * (theta - r))
    # dw/dt = ar makes ds/dt = 0
    assert ar - ddr + lam * (w - dr) == pytest.approx(0.0, abs=1e-12)
    made = lg.sliding_error(kind="velocity")
    assert made.input_labels == ["w", "r", "dr"]
    assert list(made.output(0.0, [], [w, r, dr])) == [w - r, dr]


@given(few, st.floats(-0.4, 0.4), deflections, deflections, st.floats(0.01, 50.0))
def test_slotine_li_with_the_existing_observer(s, w, z, zhat, k):
    """dV/dt as in the docstring, and not above 0 where |w|/h <= 4/sigma1 (1 + KD/(k sigma1))."""
    KD, x = 0.1, rate(w) / P.sigma0
    made = lg.existing_observer(P, k)
    (Fhat, _), (dzhat,) = (made.output(0.0, [zhat], [w, s]), made.dynamics(0.0, [zhat], [w, s]))
    dz = w - rate(w) * z
    F = P.sigma0 * z + P.sigma1 * dz + P.Fv * w
    (tau,) = lg.slotine_li(P, KD).output(0.0, [], [s, 0.7])
    ds = (tau + Fhat - F) / P.J - 0.7
    ez = z - zhat
    dV = P.J * s * ds + P.sigma0 * ez * (dz - dzhat) / k
    expected = -(KD + P.sigma1 * k) * s**2 + P.sigma0 * x * ez * (P.sigma1 * s - P.sigma0 * ez / k)
    assert dV == pytest.approx(expected, abs=1e-9 * (1 + k + 1 / k))
    if x <= 4 / P.sigma1 * (1 + KD / (k * P.sigma1)):
        assert expected <= 1e-12


@given(few, few, few, st.tuples(few, few, few), st.tuples(gains, gains, gains))
def test_adaptive_slotine_li_lyapunov_function(s, ar, w, found, adapt):
    """dV/dt = -KD s^2 on a drive with Coulomb and viscous friction."""
    made = lg.adaptive_slotine_li(0.1, *adapt)
    rates = made.dynamics(0.0, found, [s, ar, w])
    truth = P.J, P.Fv, P.Fc
    (tau,) = made.output(0.0, found, [s, ar, w])
    ds = (tau - P.Fc * np.tanh(w / 0.01) - P.Fv * w) / P.J - ar
    errors = zip(truth, found, rates, adapt, strict=True)
    dV = P.J * s * ds + sum(-(a - b) * db / g for a, b, db, g in errors)
    assert dV == pytest.approx(-0.1 * s**2, abs=1e-9)


@given(few, few, few, deflections, st.tuples(deflections, deflections, few, few, few))
def test_dual_observer_lyapunov_function(s, ar, w, z, states):
    """dV/dt = -KD s^2 - sigma0 a e0^2/k0 - sigma1 a e1^2/k1, without any condition."""
    own = {"k0": 0.5, "k1": 0.02, "g0": 50.0, "g1": 3.0, "g2": 0.7}
    made, a = lg.dual_observer_control(P, **own), rate(w)
    dz0, dz1, *adapted = made.dynamics(0.0, states, [s, ar, w])
    (tau,) = made.output(0.0, states, [s, ar, w])
    dz = w - a * z
    ds = (tau - P.sigma0 * z - P.sigma1 * dz - P.Fv * w) / P.J - ar
    e0, e1 = z - states[0], z - states[1]
    truth = P.sigma0, P.sigma1, P.sigma1 + P.Fv
    dV = P.J * s * ds + P.sigma0 * e0 * (dz - dz0) / 0.5 + P.sigma1 * e1 * (dz - dz1) / 0.02
    for real, x, dx, g in zip(truth, states[2:], adapted, (50.0, 3.0, 0.7), strict=True):
        dV -= (real - x) * dx / g
    expected = -0.1 * s**2 - P.sigma0 * a * e0**2 / 0.5 - P.sigma1 * a * e1**2 / 0.02
    assert dV == pytest.approx(expected, rel=1e-8, abs=1e-8 * (1 + a))


@given(few, few, st.floats(-0.5, 0.5), few)
def test_backstepping_closed_loop_of_the_surface(s, ar, q, error):
    """dy/dt = -eD/J - ks y - eps y/sqrt(y^2 + phi^2) with Fhat = F - eD."""
    made = lg.backstepping_smc(P)
    tau, y = made.output(0.0, [q], [s, ar])
    (dq,) = made.dynamics(0.0, [q], [s, ar])
    dy = (tau - error) / P.J - ar + dq
    assert y == s + q
    expected = -error / P.J - 100 * y - 5 * y / np.hypot(y, 0.01)
    assert dy == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(few, few, few, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_open_predictor_converges_for_every_delay(w, wp, u, a, ahat):
    """J e de/dt <= -Fv e^2 + |a - ahat| |e|, e = w(t + h) - wp(t), on Coulomb friction."""
    (dwp,) = lg.coulomb_predictor(P).dynamics(0.0, [wp], [u, ahat])
    dw = (u - a * np.tanh(w / 1e-4) - P.Fv * w) / P.J
    e = w - wp
    assert P.J * e * (dw - dwp) <= -P.Fv * e**2 + abs(a - ahat) * abs(e) + 1e-9


@given(few, few, st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6))
def test_memory_is_the_law_with_a_delay_of_one_period(s, ar, x):
    made = lg.repetitive_memory(P, 0.5, 0.1, K=0.3, gamma=0.2, limit=1.0)
    assert made.nstates == 6 and made.dt == 0.1
    v = np.clip(x[1], -1.0, 1.0) - 0.2 * s  # of 5 samples ago
    assert made.output(0.0, x, [s, ar]) == pytest.approx(P.J * ar - 0.3 * s + v)
    assert made.dynamics(0.0, x, [s, ar]) == pytest.approx([*x[1:], v])
    law = members("controller")["repetitive_memory"]  # as it is listed
    listed = law(s, ar, x[1], J=P.J, K=0.3, gamma=0.2, limit=1.0)
    assert listed == pytest.approx((P.J * ar - 0.3 * s + v, v))
    mean = lg.repetitive_memory(P, 0.5, 0.1, K=0.3, gamma=0.2, limit=1.0, smooth=True)
    old = np.dot([0.25, 0.5, 0.25], np.clip(x[:3], -1.0, 1.0))
    assert mean.dynamics(0.0, x, [s, ar])[-1] == pytest.approx(old - 0.2 * s)


@given(st.lists(few, min_size=7, max_size=7), few, few, st.floats(0.0, 9.0))
def test_harmonics_are_a_fourier_series_in_rotating_coordinates(x, s, ar, t):
    """xj = cj cos(j om t) + dj sin(j om t) with dcj/dt = -gamma s cos, ddj/dt = -gamma s sin."""
    made, om = lg.repetitive_control(P, 2.0, K=0.3, gamma=1.5, harmonics=3), np.pi
    rates = made.dynamics(0.0, x, [s, ar])
    assert made.output(0.0, x, [s, ar]) == pytest.approx(P.J * ar - 0.3 * s + sum(x[:4]))
    assert rates[0] == pytest.approx(-1.5 * s)
    for j in (1, 2, 3):
        co, si = np.cos(j * om * t), np.sin(j * om * t)
        c, d = x[j] * co - x[3 + j] * si, x[j] * si + x[3 + j] * co
        dc, dd = -1.5 * s * co, -1.5 * s * si
        dx = dc * co + dd * si + j * om * (d * co - c * si)
        dy = -dc * si + dd * co - j * om * (c * co + d * si)
        assert (rates[j], rates[3 + j]) == pytest.approx((dx, dy), abs=1e-9)


NAMES = ["slotine_li", "adaptive_slotine_li", "dual_observer_control", "backstepping_smc"]

NAMES += ["repetitive_control"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop])
def test_ready_loops_take_every_controller(make, name):
    made = make(P, "lyapunov", controller=name, load=True)
    needs = ["r", "dr"] if make is lg.velocity_loop else ["r", "dr", "ddr"]
    assert made.input_labels == [*needs, "d"]
    assert made.output_labels == ["theta", "w", "F", "Fhat", "u", "e"]
    assert name in [block.name for block in made.syslist]
    smooth = make(P, None, controller=name, prefilter=True)
    assert smooth.input_labels == needs[:-1]
    for loop in (made, smooth):
        u = [0.1] * loop.ninputs
        assert np.isfinite(loop.dynamics(0.0, np.full(loop.nstates, 1e-3), u)).all()
