"""Strict positive realness of random transfer functions: a dense grid and invariances."""

import math
from fractions import Fraction as Q

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lugrectl.linear import spr_check

coefficients = st.integers(-9, 9).map(lambda k: Q(k, 2))
positives = st.integers(1, 40).map(lambda k: Q(k, 4))


def convolve(a, b):
    return [sum(a[i] * b[k - i] for i in range(len(a)) if 0 <= k - i < len(b))
            for k in range(len(a) + len(b) - 1)]  # fmt: skip


def total(T, U):
    left, right = convolve(T[0], U[1]), convolve(U[0], T[1])
    size = max(len(left), len(right))
    pad = [[Q(0)] * (size - len(x)) + list(x) for x in (left, right)]
    return [x + y for x, y in zip(*pad, strict=True)], convolve(T[1], U[1])


@st.composite
def anything(draw):
    """Any T up to order 6: mostly not positive real."""
    den = [draw(positives), *draw(st.lists(coefficients, min_size=0, max_size=6))]
    return draw(st.lists(coefficients, min_size=1, max_size=len(den) + 1)), den


@st.composite
def near_passive(draw):
    """Up to three passive terms, less a constant or with a lag: near the border, order <= 6."""
    T = [draw(coefficients.map(abs)) - draw(st.sampled_from([0, 0, Q(1, 8)]))], [Q(1)]
    for _ in range(draw(st.integers(1, 3))):
        a, b, c = draw(positives), draw(positives), draw(positives)
        rlc, rc = ([c, Q(0)], [Q(1), a, b]), ([c], [Q(1), a])
        T = total(T, draw(st.sampled_from([rlc, rc])))
    lag = len(T[1]) < 7 and draw(st.booleans())
    return (T[0], convolve(T[1], [draw(positives) / 40, Q(1)])) if lag else T


GRID = np.geomspace(1e-4, 1e4, 100_001)
transfers = st.one_of(anything(), near_passive())


def on_grid(T):
    """Rightmost pole and cos(arg T(jw)) over a dense grid with the corner frequencies in it."""
    num, den = ([float(c) for c in x] for x in T)
    poles = np.roots(den)
    corners = np.abs(np.concatenate([poles, np.roots(num)]))
    w = np.concatenate([GRID, corners[corners > 0]])
    with np.errstate(all="ignore"):
        values = np.polyval(num, 1j * w) / np.polyval(den, 1j * w)
        cosine = values.real / np.abs(values)
    degree = len(den) - len(np.trim_zeros(num, "f"))
    pole = max(poles.real, default=-math.inf)
    if degree < -1 or (degree == -1 and np.trim_zeros(num, "f")[0] < 0):
        pole = math.inf  # at infinity, repeated or with a negative residue
    return pole, cosine[np.isfinite(cosine)], degree


def reduced(T):
    """Whether np.roots sees a common root (then the grid's poles are not T's)."""
    poles, zeros = (np.roots([float(c) for c in x]) for x in T)
    return np.any(np.abs(poles[:, None] - zeros[None, :]) < 1e-2)


@settings(max_examples=40)
@given(transfers)
def test_spr_never_disagrees_with_a_decisive_grid(T):
    assume(any(T[0]) and not reduced(T))
    verdict = spr_check(T)
    pole, cosine, degree = on_grid(T)
    if pole > 1e-3 or cosine.min() < -1e-6:
        assert verdict.classification == "not PR", verdict.reason
    elif pole < -1e-3 and cosine.min() > 1e-6:
        at_rest = ("SPR", "WSPR") if T[0][-1] else ("PR",)  # a zero at s = 0
        assert verdict.classification in at_rest, verdict.reason
        assert verdict.band_edge == math.inf
        if degree == 0 and T[0][-1]:
            assert verdict and verdict.margin > 0


@settings(max_examples=12)
@given(transfers, positives, positives)
def test_spr_is_invariant_under_positive_scaling_and_time_scaling(T, gain, rate):
    verdict = spr_check(T)
    faster = [[c / rate ** (len(x) - 1 - i) for i, c in enumerate(x)] for x in T]  # T(s/rate)
    for other, factor in (([[gain * c for c in T[0]], T[1]], 1), (faster, float(rate))):
        again = spr_check(other)
        assert again.classification == verdict.classification
        assert again.margin == pytest.approx(factor * verdict.margin, rel=1e-12)
        assert again.band_edge == pytest.approx(factor * verdict.band_edge, rel=1e-12)
