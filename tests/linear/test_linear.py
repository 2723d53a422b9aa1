"""L2 gain, bandwidth and the loops' transfer functions, against closed forms and control."""

from __future__ import annotations

import json
import math
import re
import warnings
from fractions import Fraction as Q
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.linear import (
    NoBandwidthWarning,
    UnstableLoopWarning,
    bandwidth,
    bandwidth_check,
    l2_check,
    position_loop_tf,
    position_T,
    spr_check,
    velocity_loop_tf,
)

P = SimpleNamespace(J=0.0022, sigma0=260.0, sigma1=0.6, Fc=0.285, Fs=0.335, Fv=0.018, vs=0.01)
HZ = 2 * np.pi


def parameters(**changes):
    return SimpleNamespace(**{**vars(P), **changes})


# --- L2 gain -----------------------------------------------------------------------------


@pytest.mark.parametrize("K2", [22.0, -22.0, 0.0, 0.5, 0.95, 1e4])
def test_l2_gain_is_the_h_infinity_norm(K2):
    verdict = l2_check(P, K2=K2)
    norm = ct.norm(ct.tf([P.J, K2], [P.sigma1, P.sigma0]), "inf", print_warning=False)
    assert verdict and verdict.gain == pytest.approx(norm, rel=1e-6)
    assert verdict.frequency == (0 if abs(K2) / 260 > 0.0022 / 0.6 else math.inf)


@pytest.mark.parametrize(
    ("changes", "K2", "gain", "frequency"),
    [
        ({"sigma1": 0.0}, 22.0, math.inf, math.inf),
        ({"sigma0": 0.0}, 22.0, math.inf, 0.0),
        ({"sigma0": 0.0}, 0.0, 0.0022 / 0.6, 0.0),
        ({"sigma0": 256.0, "sigma1": 0.5, "J": 0.25}, 128.0, 0.5, 0.0),  # pole meets zero
        ({"sigma0": 256.0, "sigma1": 0.5, "J": 0.25}, -128.0, 0.5, 0.0),  # all-pass
        ({"sigma1": -0.6}, 22.0, math.inf, math.nan),
        ({"sigma0": -256.0, "sigma1": 0.5, "J": 0.25}, -128.0, math.inf, math.nan),
        ({"sigma0": -260.0, "sigma1": -0.6}, 22.0, 22 / 260, 0.0),
        ({"sigma0": 1e-300}, 1e300, math.inf, 0.0),
    ],
)
def test_l2_edge_cases(changes, K2, gain, frequency):
    verdict = l2_check(parameters(**changes), K2=K2)
    assert verdict.gain == pytest.approx(gain, rel=1e-15)
    assert bool(verdict) == math.isfinite(gain)
    assert verdict.frequency == frequency or math.isnan(verdict.frequency) == math.isnan(frequency)
    assert verdict.reason


@pytest.mark.parametrize(
    ("changes", "K2", "word"),
    [
        ({"sigma0": 0.0, "sigma1": 0.0}, 1.0, "denominator"),
        ({"sigma0": None}, 1.0, "sigma0"),
        ({"J": math.nan}, 1.0, "J"),
        ({}, math.inf, "K2"),
        ({}, "22", "K2"),
    ],
)
def test_l2_says_what_is_wrong(changes, K2, word):
    with pytest.raises(InputError, match=word):
        l2_check(parameters(**changes), K2=K2)


def test_l2_meaning_where_little_follows():
    assert "does not decay" in l2_check(parameters(sigma0=0.0), K2=0.0).meaning
    assert "nothing follows" in l2_check(parameters(sigma1=0.0), K2=22.0).meaning
    rigid = l2_check(parameters(sigma1=0.0, J=0.0), K2=22.0).meaning  # e_z = -K2/sigma0 e_w
    assert "e_z(0)" not in rigid and "e_z tends to 0" in rigid


# --- bandwidth ---------------------------------------------------------------------------


def test_bandwidth_of_the_velocity_loop():
    T = velocity_loop_tf(P, kp=1.6, ki=0.16)
    assert bandwidth(T) / HZ == pytest.approx(115.5, abs=0.05)
    assert bandwidth(T, "half-power") / HZ == pytest.approx(115.8, abs=0.05)
    assert bandwidth(T) == pytest.approx(ct.bandwidth(T), rel=1e-9)
    assert bandwidth(T, -6) == pytest.approx(ct.bandwidth(T, -6), rel=1e-9)
    c, J, kp, ki = 10**-0.3, P.J, 1.6, 0.16
    x = np.roots([c * J**2, c * (kp**2 - 2 * J * ki) - kp**2, -(1 - c) * ki**2]).max()
    assert bandwidth(T) == pytest.approx(math.sqrt(x), rel=1e-12)


def test_bandwidth_warns_of_the_unstable_position_loop():
    T = position_loop_tf(P, kp=15, ki=1.55)
    with pytest.warns(UnstableLoopWarning, match=r"\+0\.05167 \+- 82\.57j, -0\.1033"):
        value = bandwidth(T)
    assert value / HZ == pytest.approx(20.4, abs=0.05)
    verdict = bandwidth_check(T)
    assert not verdict and not verdict.stable and verdict.bandwidth == value
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert bandwidth_check(position_loop_tf(P, kp=15, ki=1.55, kd=0.1))


def test_no_integral_action_leaves_no_pole_at_zero():
    assert velocity_loop_tf(P, kp=1.6).poles() == pytest.approx([-1.6 / P.J])


def level_ratio(T, w):
    return abs(T(1j * w)) / abs(T(0))


@pytest.mark.parametrize(
    ("num", "den", "expected"),
    [
        ([-1], [1, 1], math.sqrt(10**0.3 - 1)),  # negative DC gain
        ([1, 0], [1, 1, 0], math.sqrt(10**0.3 - 1)),  # common s
        ([1, 1], [1, 1.1], math.inf),
        ([2], [1], math.inf),
        ([1, 1], [1], math.inf),  # improper
        ([1], [1e-9, 1], 1e9 * math.sqrt(10**0.3 - 1)),
    ],
)
def test_bandwidth_edge_cases(num, den, expected):
    assert bandwidth(ct.tf(num, den)) == pytest.approx(expected, rel=1e-13)
    assert bool(bandwidth_check((num, den))) == math.isfinite(expected)


INTEGRATOR_OF_MANY = ct.ss(np.diag(np.arange(-7.0, 1.0)), np.ones((8, 1)), np.ones((1, 8)), 0)


@pytest.mark.parametrize(
    ("T", "why"),
    [
        (ct.tf([1, 0], [1, 1]), r"T\(0\) is zero, so there is no DC gain .* from\.$"),
        (ct.tf([0], [1, 1]), r"T\(0\) is zero"),
        (ct.tf([1], [1, 0]), r"T\(0\) is infinite, so .*; of an open loop check T/\(1 \+ T\)\.$"),
        (ct.tf([1], [1, -1], 0.01), r"T\(0\) is infinite"),
        (INTEGRATOR_OF_MANY, r"T\(0\) is infinite"),
        (
            ct.frd([0.0, 1.0, 0.1], [1.0, 2.0, 3.0]),
            "at the lowest frequency is zero, so there is no",
        ),
    ],
)
def test_a_system_without_a_dc_gain_says_why_it_has_no_bandwidth(T, why):
    with pytest.warns(NoBandwidthWarning, match=f"^No bandwidth: .*{why}"):
        assert math.isnan(bandwidth(T))
    assert not bandwidth_check(T)


def test_bandwidth_lists_every_crossing_and_skips_a_touch():
    notch = ct.tf([1, 0.1, 1], [1, 2, 1])
    verdict = bandwidth_check(notch)
    assert verdict.bandwidth == verdict.crossings[0] < 1 < verdict.crossings[1]
    assert len(verdict.crossings) == 2
    for w in verdict.crossings:
        assert level_ratio(notch, w) == pytest.approx(10**-0.15, rel=1e-12)
    # |n|^2 - |n(0)|^2 |d|^2 / 2 = (7 x - 1)^2 / 50: a touch of half power at x = 1/7
    den = [1, 2, 1]
    assert bandwidth([[1, Q(2, 5), Q(1, 5)], den], "half-power") == math.inf
    assert len(bandwidth_check([[1, Q(399, 1000), Q(1, 5)], den], "half-power").crossings) == 2


def test_bandwidth_refuses_unknown_levels():
    for level in ("3dB", 3.0, math.nan):
        with pytest.raises(InputError, match="[Ll]evel"):
            bandwidth_check(([1], [1, 1]), level)


# --- verdicts ----------------------------------------------------------------------------


def test_verdicts_print_and_sum_up():
    loop = position_loop_tf(P, kp=15, ki=1.55)
    for verdict in (l2_check(P, K2=22), spr_check(position_T(P, kp=15)), bandwidth_check(loop)):
        summary = verdict.summary()
        assert json.loads(json.dumps(summary)) == summary
        assert summary["holds"] is bool(verdict)
        assert verdict.reason in str(verdict)
        assert "<table>" in verdict._repr_html_() and "< 0" not in verdict._repr_html_()
        with pytest.raises(AttributeError):
            verdict.reason = "other"
    assert "Re T(jw) &lt; 0" in spr_check(position_T(P, kp=15))._repr_html_()


S = ct.tf("s")
HIDDEN = {
    "real": ((S - 1) / ((S - 1) * (S + 1)), r"\(s = \+1 1/s\)"),
    "not controllable": (
        ct.ss([[-1, 0], [0, 1]], [[1], [0]], [[1, 1]], 0),
        r"\(s = \+1 1/s\)",
    ),
    "integrator": (S / (S * (S + 1)), r"\(s = [+-]0 1/s\)"),
    "pair": ((S**2 + 4) * (S + 2) / ((S**2 + 4) * (S + 1)), r"\+- 2j 1/s\)"),
}
CHECKS = {"spr": lg.spr_check, "l2": lg.l2_check, "bandwidth": lg.bandwidth_check}


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
@pytest.mark.parametrize("T, mode", HIDDEN.values(), ids=HIDDEN)
def test_an_unstable_mode_that_cancels_is_named(T, mode, check):
    said = check(T).reason
    assert "was cancelled from T(s): the system itself is not stable" in said

    assert re.search(mode, said)


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
def test_a_stable_mode_that_cancels_is_not_mentioned(check):
    assert "cancelled" not in check((S + 3) / ((S + 3) * (S + 1))).reason
