"""Strict positive realness of T(z): exact decisions against a sweep of the unit circle."""

from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.linear import UnstableLoopWarning

from ..cases.structures import structure

ANGLES = np.linspace(0, np.pi, 2001)


def draw(rng):
    """A T(z) of order 1 to 6: any, or a sum of passive parts."""
    order = int(rng.integers(1, 7))
    if rng.random() < 0.5:
        return passive(rng, order)
    num, den = np.poly(roots(rng, order, 1.1)), np.poly(roots(rng, order, 1.02))
    return rng.uniform(0.2, 2) * num[rng.random() < 0.1 :], den


def roots(rng, order, size):
    pairs = size * rng.random(order // 2) * np.exp(1j * np.pi * rng.random(order // 2))
    return np.concatenate([pairs, pairs.conj(), rng.uniform(-size, size, order % 2)])


def passive(rng, order):
    num, den = np.array([rng.uniform(0.01, 1)]), np.array([1.0])
    while len(den) <= order:
        p = rng.uniform(-0.99, 0.99)
        n, d = np.array([1, rng.uniform(-1, 1)]) * rng.uniform(0.1, 2), np.array([1, -p])
        if order - len(den) >= 1 and rng.random() < 0.6:
            r, angle = rng.uniform(0.2, 0.995), np.pi * rng.random()
            d = np.array([1, -2 * r * np.cos(angle), r * r])
            n = rng.uniform(0.1, 2) * np.array([1, 0, -r])
        num, den = np.polyadd(np.convolve(num, d), np.convolve(n, den)), np.convolve(den, d)
    return num, den


def swept(num, den):
    """SPR by a dense sweep: poles inside the circle, Re T > 0 at every angle."""
    z = np.exp(1j * np.append(ANGLES, np.abs(np.angle(np.roots(den)))))
    with np.errstate(all="ignore"):
        real = np.real(np.polyval(num, z) / np.polyval(den, z))
    return bool(np.abs(np.roots(den)).max() < 1 and np.min(real) > 0)


def test_the_exact_decision_is_that_of_a_sweep():
    rng, found = np.random.default_rng(1), []
    for _ in range(80):
        num, den = draw(rng)
        found.append(lg.spr_check(ct.tf(num, den, 0.01)).classification == "SPR")
        assert found[-1] == swept(num, den), (list(num), list(den))
    assert 15 < sum(found) < 65


def test_the_margin_is_where_positive_realness_ends():
    rng, seen = np.random.default_rng(3), 0
    for _ in range(10):
        T = passive(rng, int(rng.integers(1, 4)))
        if not (found := lg.spr_check(ct.tf(*T, 0.01))):
            continue
        seen += 1
        radii = [math.exp(-0.01 * found.margin * f) for f in (1 - 1e-6, 1 + 1e-6)]
        inner = [[p * r ** np.arange(len(p))[::-1] for p in T] for r in radii]
        less, more = (lg.spr_check(ct.tf(*p, 0.01)).classification for p in inner)
        assert less != "not PR" and more == "not PR"
    assert seen > 5


def test_a_fast_sampled_system_has_the_margin_and_band_edge_of_the_continuous_one():
    T = ct.tf([1, 2], [1, 4, 5]) + 0.1
    fast = ct.sample_system(T, 1e-4, "tustin")
    assert lg.spr_check(fast).margin == pytest.approx(lg.spr_check(T).margin, rel=1e-3)
    falls = ct.tf([1, 10], [1, 2, 0.5])
    fast = lg.spr_check(ct.sample_system(falls, 1e-3, "tustin"))
    assert fast.band_edge == pytest.approx(lg.spr_check(falls).band_edge, rel=1e-4)
    assert fast.classification == "not PR"


def test_margin_and_frequencies_are_per_second_or_per_sample():
    T = [1, 0.5], [1, -0.5]  # zero and pole at |z| = 1/2
    assert lg.spr_check(ct.tf(*T, 0.1)).margin == pytest.approx(10 * math.log(2))
    assert lg.spr_check(ct.tf(*T, True)).margin == pytest.approx(math.log(2))
    found = lg.spr_check(ct.tf([1, 1], [1, -0.3], 0.1))  # Re T = 0 at half the rate only
    assert (found.classification, found.band_edge) == ("PR", pytest.approx(10 * math.pi))


@pytest.mark.parametrize(
    ("T", "kind", "words"),
    [
        (ct.tf([1], [1, -0.5], 0.1), "not PR", "delay of 1 sample"),
        (ct.tf([1, 0, 0], [1, 0.1], 0.1), "not PR", "1 sample ahead"),
        (ct.tf([1, 0.2], [1, 1.1], 0.1), "not PR", "poles outside the unit circle (z = -1.1)"),
        (ct.tf([1, 0], [1, -1], 0.1), "PR", "unit circle at w = 0 rad/s"),
        (ct.tf([1, 0], [1, 1], 0.1), "PR", "unit circle at w = 31.4159 rad/s"),
        (ct.tf([1, 0, 0], [1, -2, 1], 0.1), "not PR", "Re T(exp(jw dt)) < 0"),
        (ct.tf([1, 1], [1, -1], 0.1), "PR", "lossless"),
        (ct.tf([-1, -1], [1, -1], 0.1), "not PR", "residue is not positive"),
        (ct.tf([0], [1], 0.1), "PR", "T is zero"),
        (ct.tf([3], [2], 0.1), "SPR", "no poles"),
        (ct.tf([1, 0.3], [1, -0.2], 0.1), "SPR", "the least 0.583333 at w = 31.4159 rad/s"),
    ],
)
def test_each_kind_says_why(T, kind, words):
    found = lg.spr_check(T)
    assert found.classification == kind and words in found.reason, found.reason
    assert bool(found) == (kind == "SPR") and (found.margin > 0) == (kind == "SPR")


def test_an_unstable_mode_that_cancels_from_a_sampled_system_is_named():
    z = ct.tf("z")
    T = (z - 1.5) * (z + 0.25) / ((z - 1.5) * (z - 0.5))
    for check in (lg.spr_check, lg.l2_check, lg.bandwidth_check):
        assert "(z = +1.5) was cancelled from T(z)" in check(T).reason


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("modes, through", [(4, 0.01), (4, 0.0), (4, -0.005), (10, 0.01)])
def test_many_states_are_decided_as_in_continuous_time(modes, through, turned):
    """The bilinear map keeps SPR, PR and not PR; other coordinates change nothing."""
    T = structure(modes, through, turned=turned, high=1e2)
    found, wanted = lg.spr_check(ct.sample_system(T, 1e-3, "tustin")), lg.spr_check(T)
    assert found.classification == wanted.classification
    assert found.margin == pytest.approx(wanted.margin, rel=1e-3)
    assert "floating point" in found.reason


def test_the_bandwidth_of_a_sampled_system_is_where_its_response_falls():
    T = ct.sample_system(ct.tf([400.0], [1, 4, 400]), 0.01)
    width = lg.bandwidth(T)
    assert abs(T(np.exp(0.01j * width))) == pytest.approx(10 ** (-3 / 20) * abs(T(1)), rel=1e-9)
    grown = ct.append(ct.ss(T), *[ct.ss(0.1 * k, 1, 1, 0, 0.01) for k in range(6)])
    many = ct.ss(grown.A, grown.B[:, :1], grown.C[:1], grown.D[:1, :1], 0.01)
    assert lg.bandwidth(many) == pytest.approx(width, rel=1e-9)
    assert "|T(exp(jw dt))| falls through" in lg.bandwidth_check(T).reason
    with pytest.warns(UnstableLoopWarning, match=r"z = \+1.1"):
        lg.bandwidth(ct.tf([1, 0.3], [1, -1.1], 0.1))
    assert lg.bandwidth(ct.tf([1, 0.01], [1, -0.01], 0.1)) == math.inf
    with pytest.warns(UserWarning, match="no DC gain"):
        assert math.isnan(lg.bandwidth(ct.tf([1, -1], [1, 0.1], 0.1)))
