"""Models of many states: the verdicts of exact arithmetic, in any coordinates, in little time."""

from __future__ import annotations

import math
import re
import time

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.linear.system import Signs, realness
from lugrectl.linear.systems import ExactSystem

from ..cases.structures import structure


@pytest.mark.parametrize("turned", [False, True])
def test_the_verdict_on_many_states_is_that_of_exact_arithmetic(turned):
    T = structure(4, turned=turned)
    found, exact = lg.spr_check(T), realness(ExactSystem.of(structure(4)))
    assert found.classification == exact.kind == "SPR"
    assert found.margin == pytest.approx(exact.margin, rel=1e-5)
    assert "floating point" in found.reason


@pytest.mark.parametrize(("modes", "seed"), [(3, 0), (10, 1)])
def test_other_coordinates_are_no_other_verdict(modes, seed):
    """Without feedthrough T(0) = 0: PR, and never "not PR" by rounding."""
    kinds = [
        lg.spr_check(structure(modes, 0.0, turned=turned, seed=seed)).classification
        for turned in (False, True)
    ]
    assert kinds == ["PR", "PR"]
    with_more = [structure(modes, 0.01, turned=turned, seed=seed) for turned in (False, True)]
    found = [lg.spr_check(T) for T in with_more]
    assert [one.classification for one in found] == ["SPR", "SPR"]
    assert found[0].margin == pytest.approx(found[1].margin, rel=1e-4)


def test_a_negative_real_part_is_found_with_its_band():
    T = structure(5, -0.005, turned=True)
    found = lg.spr_check(T)
    assert (found.classification, found.band_edge) == ("not PR", 0.0)
    high = float(re.findall(r"[\d.]+", found.reason.split("Re T(jw) < 0 for w < ")[1])[0])
    assert T(1j * 0.99 * high).real < 0 < T(1j * 1.01 * high).real


def test_time_grows_no_faster_than_the_third_power():
    T = structure(15)
    begin = time.process_time()
    assert lg.spr_check(T)
    assert lg.bandwidth(structure(15, 0.0, displacement=True)) > 0
    assert lg.bandwidth_check(structure(15)).bandwidth > 0
    unstable = structure(8, 0.0, displacement=True)
    unstable.A[1, 1] = 0.02
    assert not lg.bandwidth_check(unstable)
    assert time.process_time() - begin < 10.0  # it took 256 s


def test_an_unstable_mode_that_cancels_is_named_at_any_order():
    T = structure(4, turned=False)
    A = np.zeros((9, 9))
    A[:8, :8], A[8, 8] = T.A, 0.5
    B, C = np.vstack([T.B, [[0.0]]]), np.hstack([T.C, [[1.0]]])
    found = lg.spr_check(ct.ss(A, B, C, T.D))
    assert found and "s = +0.5 1/s" in found.reason


def test_an_edge_that_rounding_blurs_is_a_range():
    """x (x - 1) with a rounding of 1e-4 crosses 0 somewhere near 1, surely not far from it."""
    made = Signs.of(lambda x: (x * (x - 1), 1e-4), [0.0, 0.5, 1.0, 2.0])
    (edge,) = made.edges
    assert edge.at == pytest.approx(1.0) and not edge.sharp
    assert 0.9995 < edge.low < 1 - 1e-4 < 1 + 1e-4 < edge.high < 1.0005
    assert edge.first == edge.low and f"between {edge.low:.9g} and" in str(edge)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0, True])
def test_the_norm_is_reached_and_passed_nowhere(dt):
    """Of random systems of 1 to 12 states, half of them lightly damped."""
    rng, w = np.random.default_rng(1), np.geomspace(1e-3, math.pi, 4000)
    for n in range(1, 13):
        A, least = rng.standard_normal((n, n)), 10.0 ** rng.uniform(-3, 0)
        poles = np.linalg.eigvals(A)
        A = A * math.exp(-least) / np.abs(poles).max() if dt else A - np.eye(n) * poles.real.max()
        A = A if dt else A - least * np.eye(n)
        T = ct.ss(A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), rng.normal(), dt)
        found = lg.l2_check(T)
        assert np.abs(T(np.exp(1j * w) if dt else 1j * w)).max() <= found.gain * (1 + 1e-9)
        if math.isfinite(x := found.frequency):
            there = abs(T(np.exp(1j * x) if dt else 1j * x))
            assert there == pytest.approx(found.gain, rel=1e-9)


@pytest.mark.parametrize("high", [1e2, 1e4])
def test_a_bilinear_map_keeps_the_norm(high):
    """At 1e-4 s the poles of slow modes all but meet at z = 1."""
    T = structure(5, 0.0, turned=True, high=high)
    fast = lg.l2_check(ct.sample_system(T, 1e-4, "tustin"))
    assert fast.gain == pytest.approx(lg.l2_check(T).gain, rel=1e-6)


@pytest.mark.parametrize("dt", [0, True])
def test_several_channels_have_the_largest_singular_value(dt):
    rng = np.random.default_rng(5)
    A = rng.standard_normal((9, 9))
    A = 0.95 * A / np.abs(np.linalg.eigvals(A)).max() - (0 if dt else 1.0) * np.eye(9)
    T = ct.ss(A, rng.standard_normal((9, 2)), rng.standard_normal((3, 9)), 0, dt)
    w = np.linspace(0, math.pi if dt else 20, 4001)
    s = np.exp(1j * w) if dt else 1j * w
    swept = np.linalg.norm(np.moveaxis(T(s), -1, 0), 2, axis=(1, 2)).max()
    found = lg.l2_check(T)
    assert swept * (1 - 1e-12) <= found.gain <= swept * (1 + 1e-4)
    assert "singular value" in found.reason


@pytest.mark.parametrize("dt", [0, True])
def test_a_hidden_mode_on_the_border_leaves_the_gain_and_one_beyond_it_does_not(dt):
    """Of many states as of few."""
    border, beyond = (1.0, 1.5) if dt else (0.0, 0.5)
    for few in (0, 6):
        own = ct.ss([[0.5 if dt else -1.0]], [[1.0]], [[1.0]], 0, dt)
        more = [ct.ss(0.1 if dt else -2.0, 1, 1, 0, dt)] * few
        for hidden, finite in ((border, True), (beyond, False)):
            T = ct.append(own, *more, ct.ss(hidden, 1, 1, 0, dt))
            found = lg.l2_check(ct.ss(T.A, T.B[:, :1], T.C[:1], T.D[:1, :1], dt))
            assert bool(found) == finite and "not stable" in found.reason
            assert found.gain == pytest.approx((2.0 if dt else 1.0) if finite else math.inf)


def test_a_system_that_is_not_stable_has_no_gain_and_names_its_pole():
    A = np.diag([-1.0, -2.0, -3.0, -4.0, -5.0, -6.0, 0.5])
    T = ct.ss(A, np.ones((7, 1)), np.ones((1, 7)), 0)
    found = lg.l2_check(T)
    assert not found and "not stable (poles +0.5, -1" in found.reason
    T = ct.ss(A / 4, np.ones((7, 1)), np.ones((1, 7)), 0, 0.1)
    assert not lg.l2_check(T) and "(z = -1.5, " in lg.l2_check(T).reason
    assert not lg.l2_check(ct.tf([1], [1, -1.5], 0.1))


def slow_beside_fast(slow, fast, n):
    """slow/(s + slow) in front of n - 1 lags: the poles stand on the diagonal, the gain is 1."""
    T = ct.ss(-slow, slow, 1.0, 0.0)
    for k in range(n - 1):
        T = T * ct.ss(-fast * (1 + 0.1 * k), 1.0, fast * (1 + 0.1 * k), 0.0)
    return T


@pytest.mark.parametrize(("slow", "fast", "n"), [(1e-6, 1e6, 7), (1e-8, 1e5, 9)])
def test_a_pole_within_rounding_of_the_axis_is_decided_exactly(slow, fast, n):
    assert lg.l2_check(slow_beside_fast(slow, fast, n)).gain == pytest.approx(1.0)
    unstable = lg.l2_check(slow_beside_fast(-slow, fast, n))
    assert unstable.gain == math.inf and "not stable" in unstable.reason


def test_where_stability_is_not_decided_this_is_said():
    said = lg.l2_check(slow_beside_fast(1e-6, 1e6, 18)).reason
    assert "whether the system is stable is within rounding" in said


CHECKS = [lg.spr_check, lg.bandwidth_check, lg.l2_check, lg.stability_check]
AXIS = ct.ss([[0.0, 1.0, 0.0], [0.0, -3.0, 5.0], [0.0, 0.0, -40.0]], [[0], [0], [7.0]],
             [[1.0, 0.2, 0.0]], 0.0)  # fmt: skip


@pytest.mark.parametrize("check", CHECKS)
def test_without_a_sample_time_the_answer_is_per_sample(check):
    """The angles of a loop with 1 s, and no Hz and no seconds."""
    found, known = (check(ct.tf([0.3], [1.0, -0.7], dt)) for dt in (True, 1.0))
    assert "per sample" in found.reason and "give its dt" in found.reason
    assert not re.search(r"\d rad/s\b|\d s\b|\d Hz", str(found))
    if check is lg.bandwidth_check:
        assert math.isnan(found.hertz) and found.bandwidth == known.bandwidth
    assert "per sample" not in known.reason


def test_a_free_axis_as_a_transfer_function_is_the_axis():
    """The conversion leaves 1e-14 s^2 in the numerator and a pole at 1e-15."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    S = ct.ss(turn @ AXIS.A @ turn.T, turn @ AXIS.B, AXIS.C @ turn.T, 0.0)
    found, axis = lg.stability_check(ct.tf(S)), lg.stability_check(AXIS)
    assert found.stable_gains == axis.stable_gains == ((0.0, math.inf),)
    assert found.gain_range == axis.gain_range and found.open_poles == 0
    assert found.phase_margin == pytest.approx(axis.phase_margin, rel=1e-9)
    assert "only rounding keeps from 0" in found.reason and "rounding" not in axis.reason


@pytest.mark.parametrize("gain", [1e-200, 1e-20, 1.0, 1e200])
def test_a_small_or_large_gain_is_no_rounding(gain):
    found = lg.stability_check(ct.tf([gain], [1.0, 2.0, 1.0]))
    assert found.stable_gains == ((0.0, math.inf),) and "rounding" not in found.reason


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("size", [1e-300, 1e-200, 1e200])
def test_matrices_of_any_size_are_answered_or_refused(check, size):
    many = ct.ss(-size * np.eye(9), np.ones((9, 1)), np.ones((1, 9)), 1.0)
    with pytest.raises(lg.InputError, match="in another unit"):
        check(many)
    few = ct.ss(-size * np.eye(2), np.ones((2, 1)), np.ones((1, 2)), 1.0)
    assert bool(check(few)) in (True, False)


def test_many_states_with_a_pole_at_0_are_decided_at_once():
    whole = ct.append(structure(10, 0.1), ct.ss([[0.0]], [[1.0]], [[1.0]], 0.0))
    for sign, kind in ((1.0, "PR"), (-1.0, "not PR")):
        B, C = whole.B.sum(axis=1, keepdims=True), np.array(whole.C)
        C[1] *= sign
        T = ct.ss(whole.A, B, C.sum(axis=0, keepdims=True), 0.1)
        found = lg.spr_check(T)
        assert found.classification == kind and "within rounding" in found.reason
        width = lg.bandwidth_check(T)
        assert math.isnan(width.bandwidth) and "T(0) is infinite" in width.reason


def test_a_sign_that_rounding_hides_at_low_frequency_is_told():
    """Speed over force: Re T is 0 at w = 0, and sampled it is a rounding error there."""
    T = structure(6, 0.0)
    T = ct.sample_system(ct.ss(T.A, T.B, T.C * (1 - 2 * (np.arange(12) > 7)), T.D), 3e-4)
    found = lg.spr_check(T)
    assert found.classification == "not PR" and found.band_edge > 1
    assert "rounding decides on its sign" in found.reason


def test_a_response_with_two_values_at_one_frequency_is_refused():
    with pytest.raises(lg.InputError, match="two values at one frequency"):
        lg.stability_check(ct.frd([1.0, 2.0j], [1.0, 1.0]))
