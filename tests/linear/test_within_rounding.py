"""What rounding, or a sample time that is not stated, leaves open is said and never guessed."""

from __future__ import annotations

import math
import re

import control as ct
import numpy as np
import pytest

import lugrectl as lg

from ..cases.structures import structure

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
        assert math.isnan(width.bandwidth) and "infinite within rounding" in width.reason


def test_an_unstable_model_of_many_states_has_its_band_edge():
    T = structure(4, -0.005)
    A = np.array(T.A)
    A[1, 1] = 0.02
    few = ct.ss(A[:2, :2], T.B[:2], T.C[:, :2], T.D)
    more = ct.append(few, ct.ss(-np.eye(6), np.zeros((6, 1)), np.zeros((1, 6)), 0.0))
    many = ct.ss(more.A, more.B[:, :1], more.C[:1], more.D[:1, :1])
    assert "poles right" in lg.spr_check(many).reason
    assert lg.spr_check(many).band_edge == lg.spr_check(few).band_edge


def test_a_sign_that_rounding_hides_at_low_frequency_is_told():
    """Speed over force: Re T is 0 at w = 0, and sampled it is a rounding error there."""
    T = structure(6, 0.0)
    T = ct.sample_system(ct.ss(T.A, T.B, T.C * (1 - 2 * (np.arange(12) > 7)), T.D), 3e-4)
    found = lg.spr_check(T)
    assert found.classification == "not PR" and found.band_edge > 1
    assert "rounding decides on its sign" in found.reason


def test_a_pole_at_half_the_rate_is_a_candidate_like_others():
    T = ct.ss(-np.eye(9), np.ones((9, 1)), np.ones((1, 9)), 1.0, 0.1)
    assert not lg.stability_check(T * 1e-3)
    assert lg.spr_check(T).classification in ("PR", "not PR")


def test_a_response_with_two_values_at_one_frequency_is_refused():
    with pytest.raises(lg.InputError, match="two values at one frequency"):
        lg.stability_check(ct.frd([1.0, 2.0j], [1.0, 1.0]))
