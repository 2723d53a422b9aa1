"""Probabilities from a number of members."""

import numpy as np
import pytest

from lugrectl.bench.chance import Chance, band, bound, enough, spared


def test_the_interval_is_that_of_clopper_and_pearson():
    assert Chance(0, 93).ci95 == pytest.approx((0.0, 0.03889), abs=1e-5)
    assert Chance(5, 100).ci95 == pytest.approx((0.01643, 0.11283), abs=1e-4)
    assert Chance(7, 7).ci95[1] == 1.0


def test_how_many_members_a_bound_needs():
    assert enough(0.95, 0) == 59 and enough(0.95) == 93
    assert spared(58, 0.95) == -1 and np.isinf(bound(np.arange(58.0), 0.95))


@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_a_bound_holds_as_often_as_it_says(confidence):
    x = np.random.default_rng(0).random((4000, enough(confidence)))
    held = np.array([bound(row, confidence) for row in x]) >= confidence
    assert 0.94 < held.mean() < 0.97


def test_a_band_holds_a_new_member():
    x = np.random.default_rng(0).normal(size=(4000, 94))
    ends = np.array([band(row[1:]) for row in x])
    inside = np.mean((x[:, 0] >= ends[:, 0]) & (x[:, 0] <= ends[:, 1]))
    assert inside == pytest.approx(0.95, abs=0.008)


def test_a_band_reaches_to_infinity_beside_members_that_diverge():
    assert band(np.r_[np.arange(90.0), np.inf, np.inf, np.inf])[1] == np.inf
    assert band(np.r_[np.arange(92.0), np.inf])[1] == pytest.approx(90.65)
