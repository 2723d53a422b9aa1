"""A transfer function with dead times is exact, and computes as one."""

import pickle

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import InputError

W = np.array([0.1, 3.0, 40.0, 700.0])
G = ct.tf([3.0, 1.0], [0.02, 1.0, 0.0])
T = 4e-3
LATE = np.exp(-1j * W * T)


def test_a_dead_time_turns_the_phase_and_nothing_else():
    found = lg.delayed(G, T)(1j * W)
    assert found == pytest.approx(G(1j * W) * LATE, rel=1e-13)
    assert np.abs(found) == pytest.approx(np.abs(G(1j * W)), rel=1e-13)


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
