"""Strict positive realness against closed forms, a dense grid and its own invariances."""

import math
from decimal import Decimal
from fractions import Fraction as Q
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

from lugrectl.core.errors import InputError
from lugrectl.linear import bandwidth_check, position_T, spr_check, velocity_T

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


@pytest.mark.parametrize(
    ("gains", "kind"),
    [
        ({"kp": 1.6}, "SPR"),
        ({"kp": 1.6, "ki": 0.16}, "PR"),
        ({"kp": 0.01, "ki": 260 * 0.01 / 0.6 * 0.999}, "PR"),
        ({"kp": 0.01, "ki": 260 * 0.01 / 0.6 * 1.001}, "not PR"),
        ({"kp": -1.6}, "not PR"),
        ({}, "PR"),  # (sigma1 s + sigma0)/(J s)
    ],
)
def test_spr_of_velocity_controllers(gains, kind):
    assert spr_check(velocity_T(P, **gains)).classification == kind


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
