"""Strict positive realness against closed forms, a dense grid and its own invariances."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction as Q
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.linear import UnstableLoopWarning, bandwidth_check, position_T, spr_check, velocity_T

from ..cases.structures import structure

P = SimpleNamespace(J=0.0022, sigma0=260.0, sigma1=0.6, Fc=0.285, Fs=0.335, Fv=0.018, vs=0.01)


def parameters(**changes):
    return SimpleNamespace(**{**vars(P), **changes})


# --- SPR: known answers ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("num", "den", "kind", "margin", "edge"),
    [
        ([1], [1, 1], "SPR", 1, math.inf),
        ([1, 2], [1, 1], "SPR", 1, math.inf),  # pole reaches the axis first
        ([1, 1], [1, 2], "SPR", 1, math.inf),  # zero does
        ([1, 1], [1], "SPR", 1, math.inf),  # relative degree -1
        ([3], [1], "SPR", math.inf, math.inf),
        ([1, 3, 2], [1, 3, 2], "SPR", math.inf, math.inf),  # all cancels
        ([1, 1], [1, 1, 1], "WSPR", 0, math.inf),  # P = 1: w^2 Re T -> 0
        ([1, 1, 1], [1, 1], "WSPR", 0, math.inf),  # its inverse: T(s - eps) -> -eps
        ([1], [1, 0], "PR", 0, 0),
        ([1, 0], [1, 0], "SPR", math.inf, math.inf),  # the common s goes first
        ([1, 0], [1, 0, 1], "PR", 0, 0),
        ([1, 1, 1], [1, 1, 0], "PR", 0, math.inf),  # 1/s + s/(s + 1)
        ([2, 1, 1], [1, 1, 1, 1], "PR", 0, math.inf),  # 1/(s + 1) + s/(s^2 + 1)
        ([1, 0, 1], [1, 1, 1], "PR", 0, 1),  # double root of P: a touch
        ([0], [1, 1], "PR", 0, 0),
        ([-1], [1, 1], "not PR", 0, 0),
        ([1], [1, -1], "not PR", 0, 0),
        ([-1, 0], [1, 0, 1], "not PR", 0, 0),  # residue -1/2 at +-j
        ([-1], [1, 0], "not PR", 0, 0),
        ([-1, 1], [1], "not PR", 0, math.inf),  # Re T = 1, but -s
        ([1, 0, 1, 0], [1, 0, 0, 0, 0], "not PR", 0, 0),  # repeated pole at 0
        ([1, 0, 1, 1], [1, 0, 2, 0, 1], "not PR", 0, math.inf),  # s/(s^2 + 1) + 1/(s^2 + 1)^2
        ([1], [1, 2, 1], "not PR", 0, 1),
        ([1, 2, 3], [1], "not PR", 0, math.sqrt(3)),
        ([1, 1], [1, 0, 4], "not PR", 0, 2),  # band ended by a pole, not by a root
    ],
)
def test_spr_known_answers(num, den, kind, margin, edge):
    verdict = spr_check((num, den))
    assert verdict.classification == kind
    assert bool(verdict) == (kind == "SPR")
    assert verdict.margin == pytest.approx(margin, rel=1e-13)
    assert verdict.band_edge == pytest.approx(edge, rel=1e-13)
    assert verdict.reason.startswith(kind) and verdict.reason.endswith(".")


@pytest.mark.parametrize(
    ("gains", "kind"),
    [
        ({"kp": 15}, "not PR"),
        ({"kp": 15, "ki": 1.55}, "not PR"),
        ({"kp": 15, "kd": 0.953}, "not PR"),
        ({"kp": 15, "kd": 0.955}, "SPR"),
        ({"kp": 0, "kd": 0.955}, "PR"),  # pole at 0
        ({"kp": -15, "kd": 0.955}, "not PR"),
        ({"kp": 15, "kd": 0.955, "ki": 1.55}, "PR"),  # zero at 0
        ({"kp": 15, "kd": 0.953, "ki": 1.55}, "not PR"),
        ({"kp": 15, "kd": 0.955, "ki": 1e4}, "not PR"),  # Kd Kp < J Ki
        ({"kp": 15, "kd": 0.955, "ki": 1.55, "tau": 0.01}, "SPR"),
        ({"kp": 15, "kd": 0.953, "ki": 1.55, "tau": 0.01}, "not PR"),
        ({"kp": 15, "kd": 0.955, "ki": 600, "tau": 0.01}, "not PR"),
        ({"kp": 15, "kd": 0.955, "ki": 1.55, "tau": 0}, "PR"),
    ],
)
def test_spr_of_position_controllers(gains, kind):
    verdict = spr_check(position_T(P, **gains))
    assert verdict.classification == kind, verdict.reason


def test_spr_names_band_edge_limit_and_poles():
    short = spr_check(position_T(P, kp=15, kd=0.953))
    assert short.band_edge == pytest.approx(math.sqrt(260 * 15 / (260 * 0.0022 - 0.6 * 0.953)))
    assert "w^2 Re T(jw) tends to -41.3223" in short.reason and "4415.88" in short.reason
    assert spr_check(position_T(P, kp=15)).band_edge == pytest.approx(math.sqrt(15 / 0.0022))
    assert "0.05167 +- 82.57j" in spr_check(position_T(P, kp=15, ki=1.55)).reason


@pytest.mark.parametrize(("kp", "kd"), [(15, 0.955), (15, 1.2), (0.5, 2.0), (900, 30.0)])
def test_spr_margin_of_pd_closed_form(kp, kd):
    # T(s - eps): sigma1 Kd - sigma0 J - sigma1 J eps >= 0, poles and zero left of the axis
    poles = np.roots([P.J, kd, kp]).real
    expected = min(kd / P.J - P.sigma0 / P.sigma1, P.sigma0 / P.sigma1, -poles.max())
    assert spr_check(position_T(P, kp=kp, kd=kd)).margin == pytest.approx(expected, rel=1e-11)


def test_spr_exact_equality():
    # sigma1 Kd = sigma0 J: weakly SPR when it holds exactly, as in binary fractions
    p = parameters(J=0.25, sigma0=2.0, sigma1=0.5)
    assert spr_check(position_T(p, kp=1, kd=1)).classification == "WSPR"
    assert spr_check(velocity_T(p, kp=0.25, ki=1)).classification == "PR"
    # decimals: exact as fractions or Decimal, a matter of rounding as floats
    J, s0, s1 = Q("0.0022"), Q(260), Q("0.6")
    assert spr_check(([s1, s0], [J, s0 * J / s1, 15])).classification == "WSPR"
    decimal = ([Decimal("0.6"), 260], [Decimal("0.0022"), Decimal("0.9533"), 15])
    assert spr_check(decimal).classification == "not PR"
    near = spr_check(position_T(P, kp=15, kd=260 * 0.0022 / 0.6))
    assert near.margin < 1e-9 and "rounding of the inputs decides" in near.reason


def test_spr_of_state_space_is_exact_and_drops_hidden_modes():
    T = ct.tf2ss(position_T(P, kp=15, kd=0.955))
    assert spr_check(T).margin == pytest.approx(0.955 / 0.0022 - 260 / 0.6, rel=1e-9)
    hidden = ct.ss([[-1, 0], [0, 5]], [[1], [0]], [[1, 1]], 0)  # 1/(s + 1), 5 is not reached
    assert spr_check(hidden).margin == 1
    assert spr_check(ct.ss([], [], [], [[2.0]])).margin == math.inf


@pytest.mark.parametrize(
    ("T", "word"),
    [
        (ct.ss(-np.eye(2) / 2, np.eye(2), np.eye(2), 0, 0.01), "2 inputs"),
        (ct.ss(-np.eye(2), np.eye(2), np.eye(2), 0), "2 inputs"),
        (([1], [0, 0]), "denominator of T"),
        (([1], [1, math.nan]), "denominator"),
        (([1j], [1, 1]), "numerator"),
        (("12", "34"), "numerator"),
        (([[1, 2]], [1, 1]), "numerator"),
        (3.0, "T is 3.0"),
    ],
)
def test_transfer_functions_that_cannot_be_understood(T, word):
    for check in (spr_check, bandwidth_check):
        with pytest.raises(InputError, match=word):
            check(T)


coefficients = st.integers(-9, 9).map(lambda k: Q(k, 2))
positives = st.integers(1, 40).map(lambda k: Q(k, 4))


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
        more = draw(st.sampled_from([rlc, rc]))
        num = np.polyadd(np.convolve(T[0], more[1]), np.convolve(more[0], T[1]))
        T = list(num), list(np.convolve(T[1], more[1]))
    lag = len(T[1]) < 7 and draw(st.booleans())
    return (T[0], list(np.convolve(T[1], [draw(positives) / 40, Q(1)]))) if lag else T


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


@settings(max_examples=25)
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


# --- SPR: sampled ------------------------------------------------------------------------


def on_circle(T):
    """T((z - 1)/(z + 1)), by powers of two: the circle is the axis, and z = -1 infinity."""
    n = max(map(len, T)) - 1
    powers = [np.poly([1.0] * k + [-1.0] * (n - k)) for k in range(n + 1)]
    num, den = (sum(float(c) * powers[len(x) - 1 - i] for i, c in enumerate(x)) for x in T)
    return ct.tf(num, den, 0.01)


@settings(max_examples=25)
@given(anything())
def test_a_sampled_system_is_what_the_map_of_its_circle_is(T):
    """SPR stays SPR; what falls off as w grows is 0 at half the rate."""
    assume(any(T[0]) and len(np.trim_zeros(T[0], "f")) <= len(T[1]))
    there, here = spr_check(T), spr_check(on_circle(T))
    falls = len(np.trim_zeros(T[0], "f")) < len(T[1])
    kind = there.classification
    assert here.classification == ("PR" if falls and kind in ("SPR", "WSPR") else kind)


def test_margin_and_frequencies_are_per_second_or_per_sample():
    T = [1, 0.5], [1, -0.5]  # zero and pole at |z| = 1/2
    assert lg.spr_check(ct.tf(*T, 0.1)).margin == pytest.approx(10 * math.log(2))
    assert lg.spr_check(ct.tf(*T, True)).margin == pytest.approx(math.log(2))
    found = lg.spr_check(ct.tf([1, 1], [1, -0.3], 0.1))  # Re T = 0 at half the rate only
    assert (found.classification, found.band_edge) == ("PR", pytest.approx(10 * math.pi))


@pytest.mark.parametrize(
    ("T", "kind", "words"),
    [
        (ct.tf([1], [1, -0.5], 0.1), "not PR", "no delay"),
        (ct.tf([1, 0, 0], [1, 0.1], 0.1), "not PR", "relative degree is -1"),
        (ct.tf([1, 0.2], [1, 1.1], 0.1), "not PR", "poles outside the unit circle (z = -1.1)"),
        (ct.tf([1, 0], [1, -1], 0.1), "PR", "unit circle at w = 0 rad/s"),
        (ct.tf([1, 0], [1, 1], 0.1), "PR", "unit circle at w = 31.4159 rad/s"),
        (ct.tf([1, 0, 0], [1, -2, 1], 0.1), "not PR", "Re T(exp(jw dt)) < 0"),
        (ct.tf([1, 1], [1, -1], 0.1), "PR", "lossless"),
        (ct.tf([-1, -1], [1, -1], 0.1), "not PR", "residue is not positive"),
        (ct.tf([0], [1], 0.1), "PR", "T is zero"),
        (ct.tf([3], [2], 0.1), "SPR", "no poles"),
        (ct.tf([1, 0.3], [1, -0.2], 0.1), "SPR", "the largest |z| = 0.2"),
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


@pytest.mark.parametrize("modes, through", [(4, 0.01), (4, 0.0), (4, -0.005)])
def test_many_states_are_decided_as_in_continuous_time(modes, through):
    """The bilinear map keeps SPR, PR and not PR; other coordinates change nothing."""
    T = structure(modes, through, turned=True, high=1e2)
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
