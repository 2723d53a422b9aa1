"""A transfer function with dead times is exact, and computes as one."""

import math
import pickle

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.linear.axis import signs, zeros
from lugrectl.linear.exact import Quasi

W = np.array([0.1, 3.0, 40.0, 700.0])
G = ct.tf([3.0, 1.0], [0.02, 1.0, 0.0])
T = 4e-3
LATE = np.exp(-1j * W * T)


def test_sums_products_quotients_and_loops_are_those_of_the_values():
    L, g, h = lg.delayed(G, T), G(1j * W) * LATE, 1 / (1j * W + 5)
    H = ct.tf([1.0], [1.0, 5.0])
    cases = {
        "+": (L + H, g + h),
        "+ of control": (H + L, g + h),
        "-": (1 - L, 1 - g),
        "*": (H * L * 2, 2 * g * h),
        "/": (1 / (1 + L), 1 / (1 + g)),
        "feedback": (L.feedback(), g / (1 + g)),
        "positive": (L.feedback(H, sign=1), g / (1 - g * h)),
    }
    for name, (made, values) in cases.items():
        assert made(1j * W) == pytest.approx(values, rel=1e-12), name


def test_dead_times_in_series_add_up_and_do_not_vanish():
    assert lg.delayed(lg.delayed(G, 0.25), 0.5).dead_times == (0.75,)
    with pytest.raises(InputError, match="before its input"):
        1 / lg.delayed(G, 0.25)


def test_the_open_loop_of_a_closed_one_is_found_again():
    L = lg.delayed(G, T)
    assert L.feedback().open_loop(1j * W) == pytest.approx(L(1j * W), rel=1e-12)
    two = (L + lg.delayed(G, 2 * T)).feedback()
    with pytest.raises(InputError, match="2 dead times"):
        _ = two.open_loop


def test_a_mode_that_cancels_is_remembered():
    unstable = ct.tf([1.0], [1.0, -2.0])
    cancelled = lg.delayed(unstable, T) * ct.tf([1.0, -2.0], [1.0, 3.0])
    assert "s = +2" in cancelled.hidden and not lg.delayed(G, T).hidden


@pytest.mark.parametrize("found", [lg.delayed(ct.frd(G, W), T), lg.delayed(G, T).frd(W)])
def test_a_measured_response_gets_the_dead_time_too_and_it_becomes_one(found):
    assert found.frdata[0, 0] == pytest.approx(G(1j * W) * LATE, rel=1e-13)


def test_it_shows_itself_and_pickles():
    L = lg.delayed(ct.tf([100.0], [1.0, 0.0]), 0.001).feedback()
    assert repr(L) == "DelayedTransfer: 100 exp(-0.001 s) / (s + 100 exp(-0.001 s))"
    assert pickle.loads(pickle.dumps(L)) == L


@pytest.mark.parametrize(
    ("given", "late", "word"),
    [
        (G, -1.0, "negative"),
        (G, np.nan, "dead_time"),
        (ct.tf([1.0], [1.0, 0.5], 0.01), T, "z\\^-k"),
        (ct.ss(np.eye(2), np.eye(2), np.eye(2), 0), T, "2 inputs"),
        ("G", T, "G is 'G'"),
    ],
)
def test_wrong_arguments_are_named(given, late, word):
    with pytest.raises(InputError, match=word):
        lg.delayed(given, late)


P = lg.table1()
GAINS = st.floats(0.2, 5.0)


def integrator(K, T):
    return lg.delayed(ct.tf([K], [1.0, 0.0]), T).feedback()


# --- bandwidth ---------------------------------------------------------------------------


@given(st.floats(0.05, 1.4))
@settings(max_examples=10, deadline=None)
def test_the_bandwidth_of_a_closed_integrator_is_the_root_of_its_equation(turn):
    """|T|^2 = 1/(1 - 2 x sin(x K T) + x^2), x = w/K."""
    K = 80.0
    fall = lambda x: 1 - 2 * x * math.sin(x * turn) + x * x - 10**0.3  # noqa: E731
    grid = np.linspace(0.0, 4.0, 4001)
    k = next(k for k in range(4000) if fall(grid[k + 1]) > 0)
    x = brentq(fall, grid[k], grid[k + 1], xtol=1e-13)
    assert lg.bandwidth(integrator(K, turn / K)) == pytest.approx(K * x, rel=1e-9)


def test_the_bandwidth_of_an_unstable_loop_comes_with_a_warning():
    with pytest.warns(UserWarning, match="2 poles right"):
        assert lg.bandwidth(integrator(100.0, 0.016)) > 100
    with pytest.warns(UserWarning, match="no DC gain"):
        assert math.isnan(lg.bandwidth(lg.delayed(ct.tf([1.0], [1.0, 0.0]), 0.1)))


# --- gain --------------------------------------------------------------------------------


def test_a_gain_approached_as_w_grows_is_that_of_the_limit():
    """(s + 0.5 exp(-s))/(s + 1): |T|^2 < 1 near 0 and up to (1 + 0.5/w)^2 beyond."""
    falling = lg.l2_check(lg.delayed(ct.tf([2.0, 1.0], [1.0, 1.0]), 0.7))
    assert falling.frequency == math.inf and falling.gain == pytest.approx(2.0, rel=1e-12)
    echo = 1 + lg.delayed(ct.tf([0.5], [1.0]), 0.3)
    assert lg.l2_check(echo).gain == pytest.approx(1.5, rel=1e-9)


def test_an_unstable_or_improper_loop_has_no_gain():
    assert lg.l2_check(integrator(100.0, 0.016)).gain == math.inf
    assert "improper" in lg.l2_check(lg.delayed(ct.tf([1.0, 0.0], [1.0]), 0.1)).reason
    with pytest.raises(InputError, match="several dead times"):
        lg.l2_check(1 + lg.delayed(1.0, 0.3) + lg.delayed(0.5, 0.4))


# --- realness ----------------------------------------------------------------------------


@given(GAINS, st.floats(1e-3, 1.0))
@settings(max_examples=10, deadline=None)
def test_a_dead_time_in_front_of_a_lag_ends_realness_where_the_phase_passes_90_deg(a, T):
    """Re of exp(-jwT)/(jw/a + 1): wT + arctan(w/a) = pi/2."""
    found = lg.spr_check(lg.delayed(ct.tf([1.0], [1 / a, 1.0]), T))
    edge = brentq(lambda w: w * T + math.atan(w / a) - math.pi / 2, 0.0, math.pi / T)
    assert found.classification == "not PR"
    assert found.band_edge == pytest.approx(edge, rel=1e-9)
    assert f"Re T(jw) < 0 first for {edge:.6g}"[:35] in found.reason


def test_the_margin_is_where_the_shifted_function_ceases_to_be_positive_real():
    found = lg.spr_check(lg.velocity_T(P, kp=1.6, dead_time=2e-3))
    w = np.linspace(0.1, 3e4, 60_001)

    def least(eps):
        s = 1j * w - eps
        return ((P.sigma1 * s + P.sigma0) / (P.J * s + 1.6 * np.exp(-s * 2e-3))).real.min()

    assert found and least(0.99 * found.margin) > 0 > least(1.01 * found.margin)


def test_a_position_loop_is_never_positive_real_with_a_dead_time():
    for T in (1e-6, 1e-4, 1e-2):
        assert lg.spr_check(lg.position_T(P, kp=15.0, kd=1.2, dead_time=T)).margin == 0


def test_the_weaker_classes_are_seen():
    lag = ct.tf([1.0], [1.0, 1.0])
    integral = lg.velocity_T(P, kp=1.6, ki=0.16, dead_time=1e-4)
    assert lg.spr_check(integral).classification == "PR"  # a zero at s = 0
    pole = 1 + lg.delayed(0.5, 0.1) + ct.tf([1.0], [1.0, 0.0])
    assert lg.spr_check(pole).classification == "PR"
    assert not lg.spr_check(pole - ct.tf([2.0], [1.0, 0.0]))
    # Re 1/(s^2 + s + 1) alone would be negative from w = 1 on; the echo keeps it above 0
    assert lg.spr_check(2 * lag + lg.delayed(lag, 0.1) * lag).classification == "SPR"
    grows = ct.tf([1.0, 0.0], [1.0]) + 2 + lg.delayed(1.0, 0.3)
    assert lg.spr_check(grows).classification == "SPR"
    assert not lg.spr_check(grows - ct.tf([2.0, 0.0], [1.0]))
    assert not lg.spr_check(grows - ct.tf([1.0, 0.0, 0.0], [1.0]))


def test_a_dead_time_on_the_highest_power_is_stable_below_1_only():
    assert zeros(Quasi.of([(0, (1, 1)), (1, (0, 0.9))])).right == 0
    assert zeros(Quasi.of([(0, (1, 1)), (1, (0, 1.1))])).right == math.inf
    assert zeros(Quasi.of([(0, (1, 1)), (1, (0, 0, 0.1))])).right == math.inf
    with pytest.raises(InputError, match="several dead times"):
        zeros(Quasi.of([(0, (1, 1)), (1, (0, 0.7)), (1.5, (0, 0.7))]))


def even(*terms):
    """Half the sum of q(s) and q(-s)."""
    q = Quasi.of(terms)
    return q + q.mirror()


def test_a_sign_that_never_settles_is_followed_to_its_first_changes():
    found = signs(even((0.5, (0, 0, 1))))
    assert not found.complete and found.changes[0] == pytest.approx(math.pi)
    with pytest.raises(InputError, match="undecided"):
        signs(even((0, (1,)), (1, (1,))))


def test_a_response_that_turns_too_often_is_refused():
    with pytest.raises(InputError, match="unit of the dead time"):
        signs(even((0, (1e16, 0, -1)), (1.0, (0, 0, 0.4))))
