"""Controllers that act on s: Lyapunov functions, bounds, and the scenarios of position control."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg

from ..cases.observed import STEP, P, believing, longer, position_error, rms, signals, sine

few = st.floats(-1.0, 1.0)
deflections = st.floats(-2e-3, 2e-3)
gains = st.floats(0.01, 10.0)


def rate(w):
    return P.sigma0 * abs(w) / (P.Fc + (P.Fs - P.Fc) * np.exp(-((w / P.vs) ** 2)))


def wired(controller, estimate=None, lam=20.0):
    """The controller on s around the drive, with or without Fhat."""
    with_it = [] if estimate is None else [estimate, lg.compensation()]
    return ct.interconnect(
        [lg.plant(P), lg.sliding_error(lam), lg.error("position"), controller, *with_it],
        inputs=["r", "dr", "ddr"],
        outputs=["theta", "w", "F", "u", "e"],
        params={},
        check_unused=False,
    )


def moved(t, size=0.1, length=1.0):
    """A smooth move to ``size``, which stays there: r, dr, ddr."""
    x = np.clip(t / length, 0.0, 1.0)
    return {
        "r": size * (10 * x**3 - 15 * x**4 + 6 * x**5),
        "dr": size * (30 * x**2 - 60 * x**3 + 30 * x**4) / length,
        "ddr": size * (60 * x - 180 * x**2 + 120 * x**3) / length**2,
    }


def set_point(system, last=5.0):
    """theta - r and u over the last second at a held set-point."""
    t = np.arange(0.0, last + STEP / 2, STEP)
    out = signals(system, lg.simulate(system, t, moved(t)))
    return (out["theta"] - moved(t)["r"])[t > last - 1], out["u"][t > last - 1]


@given(few, few, few, few, few, st.floats(0.0, 50.0))
def test_the_sliding_error_and_its_rate(theta, w, r, dr, ddr, lam):
    s, ar = lg.sliding_error(lam).output(0.0, [], [theta, w, r, dr, ddr])
    assert s == pytest.approx((w - dr) + lam * (theta - r))
    # dw/dt = ar makes ds/dt = 0
    assert ar - ddr + lam * (w - dr) == pytest.approx(0.0, abs=1e-12)
    made = lg.sliding_error(kind="velocity")
    assert made.input_labels == ["w", "r", "dr"]
    assert list(made.output(0.0, [], [w, r, dr])) == [w - r, dr]


# Slotine-Li beside a LuGre observer.


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


@longer
@pytest.mark.parametrize(
    ("k", "existing", "natural", "lyapunov"),
    [
        (0.35, 8.8e-3, 8.1e-3, 1.8e-2),
        (5.0, 1.0e-3, 8.2e-4, 8.9e-3),
        (50.0, 1.05e-4, 8.4e-5, 5.1e-3),
    ],
)
def test_slotine_li_with_wrong_levels(k, existing, natural, lyapunov):
    """The natural observer with KD + sigma1 k has the same feedback as the existing one with k."""
    low = believing(0.8)
    made = lg.existing_observer(low, k, inputs=["w", "s"])
    found = position_error(wired(lg.slotine_li(P), made))
    equal = position_error(wired(lg.slotine_li(P, 0.1 + P.sigma1 * k), lg.natural_observer(low)))
    other = position_error(wired(lg.slotine_li(P), lg.lyapunov_observer(low, k)))
    assert found == pytest.approx(existing, rel=0.01)
    assert equal == pytest.approx(natural, rel=0.01)
    assert other == pytest.approx(lyapunov, rel=0.03)


@longer
def test_slotine_li_with_exact_parameters_reaches_the_floor():
    made = lg.existing_observer(P, inputs=["w", "s"])
    assert position_error(wired(lg.slotine_li(P), made)) == pytest.approx(2.3e-7, abs=1e-8)


# Adaptive laws.


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


@longer
def test_adaptive_slotine_li_learns_from_nothing():
    """2.7 mrad, limited by tanh against bristles; without adaptation 70."""
    assert position_error(wired(lg.adaptive_slotine_li())) == pytest.approx(2.7e-3, rel=0.2)
    fast = lg.adaptive_slotine_li(gJ=1e-3, gv=0.1, gc=3.0)
    assert 1e-3 < position_error(wired(fast)) < 4e-3
    off = lg.adaptive_slotine_li(gJ=0.0, gv=0.0, gc=0.0)
    assert position_error(wired(off)) == pytest.approx(7.0e-2, rel=0.02)
    e, _ = set_point(wired(lg.adaptive_slotine_li()), 10.0)
    assert 1e-4 < rms(e) < 5e-4


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


@longer
def test_dual_observer_control_reaches_a_set_point_exactly():
    """PD alone stops 99 mrad short of it."""
    e, _ = set_point(wired(lg.dual_observer_control(P)))
    assert abs(e).max() < 1e-12
    e, _ = set_point(wired(lg.slotine_li(P)))
    assert abs(e).max() == pytest.approx(9.9e-2, abs=1e-3)


@longer
def test_dual_observer_control_follows_without_sigma0_sigma1_Fv():
    """And whatever the level: the error goes on falling, faster with higher gains."""
    found = position_error(wired(lg.dual_observer_control(P)))
    low = position_error(wired(lg.dual_observer_control(believing(0.8))))
    fast = lg.dual_observer_control(P, g0=1e7, g1=10.0, g2=1.0)
    assert position_error(wired(fast)) < found < 1.15e-3
    assert low < 1.15e-3


# Backstepping with a fast terminal sliding mode.


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


@longer
@pytest.mark.parametrize(("p", "error"), [(200.0, 1.7e-3), (1000.0, 2.4e-4)])
def test_backstepping_with_the_extended_state_observer(p, error):
    made = wired(lg.backstepping_smc(P), lg.extended_state_observer(P, p))
    assert position_error(made, extended_state_observer_what=0.0) == pytest.approx(error, rel=0.03)
    if p == 200.0:
        e, _ = set_point(made)
        assert abs(e).max() < 1e-14


@longer
def test_backstepping_without_an_observer_has_to_switch():
    assert position_error(wired(lg.backstepping_smc(P))) == pytest.approx(1.2e-2, abs=5e-4)
    hard = wired(lg.backstepping_smc(P, eps=200.0))
    assert position_error(hard) == pytest.approx(6.5e-5, abs=1e-6)


# In the ready-made loops.

NAMES = ["slotine_li", "adaptive_slotine_li", "dual_observer_control", "backstepping_smc"]
NAMES += ["repetitive_control"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("observer", [None, "existing", "temperature", "lyapunov"])
@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop])
def test_ready_loops_take_every_controller_beside_every_observer(make, observer, name):
    made = make(P, observer, controller=name, load=True)
    needs = ["r", "dr"] if make is lg.velocity_loop else ["r", "dr", "ddr"]
    assert made.input_labels == [*needs, "d"]
    assert made.output_labels == ["theta", "w", "F", "Fhat", "u", "e"]
    assert name in [block.name for block in made.syslist]
    smooth = make(P, observer, controller=name, prefilter=True)
    assert smooth.input_labels == needs[:-1]
    for loop in (made, smooth):
        u = [0.1] * loop.ninputs
        assert np.isfinite(loop.dynamics(0.0, np.full(loop.nstates, 1e-3), u)).all()


@longer
def test_a_ready_loop_is_the_same_as_blocks_wired_by_hand():
    low = believing(0.8)
    made = lg.position_loop(
        P, "existing", k=5.0, controller="slotine_li", observer_parameters=low,
        controller_gains={"KD": 0.2, "lam": 30.0},
    )  # fmt: skip
    other = wired(lg.slotine_li(P, 0.2), lg.existing_observer(low, 5.0, inputs=["w", "s"]), 30.0)
    t = np.arange(0.0, 1.0, STEP)
    one, two = (signals(x, lg.simulate(x, t, sine(t)))["theta"] for x in (made, other))
    assert one == pytest.approx(two, abs=1e-9)


@pytest.mark.parametrize("smooth", [False, 5.0])
@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop])
def test_the_reference_reaches_the_controller_with_its_derivatives(make, smooth):
    """With exact compensation w or theta follows the (filtered) reference exactly."""
    loop = make(P, "natural", controller="slotine_li", prefilter=smooth)
    linear = ct.linearize(loop, np.zeros(loop.nstates), np.zeros(loop.ninputs))
    row = loop.output_labels.index("w" if make is lg.velocity_loop else "theta")
    for om in (0.4, 7.0, 60.0):
        factors = np.array([1.0, 1j * om, -(om**2)])[: loop.ninputs]
        found = (linear(1j * om, squeeze=False)[row] * factors).sum()
        assert found == pytest.approx(smooth / (smooth + 1j * om) if smooth else 1.0, rel=1e-4)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"controller": "sliding"}, "unknown controller 'sliding'; known: pi"),
        ({"controller": "pi_limited"}, "unknown controller 'pi_limited'"),
        ({"controller": "prefilter"}, "prefilter needs r_cmd"),
        ({"controller": "feedforward"}, "feedforward needs a"),
        ({"controller": "sliding_error"}, "it has no output u"),
        ({"controller": "slotine_li", "kp": 3.0}, "kp is a gain of pi"),
        ({"controller": "slotine_li", "feedforward": True}, "contains J times the acceleration"),
        ({"controller": "slotine_li", "controller_gains": {"Kd": 1.0}}, "no parameter 'Kd'"),
        ({"controller": "slotine_li", "controller_gains": 3.0}, "controller_gains must be a dict"),
        ({"controller_gains": {"kp": 1.0}}, "pi has its own"),
    ],
)
def test_wrong_controllers_are_one_sentence(options, said):
    with pytest.raises(lg.InputError, match=said) as raised:
        lg.velocity_loop(P, "natural", **options)
    assert "\n" not in str(raised.value) and str(raised.value).endswith(".")
