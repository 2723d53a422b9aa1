"""The regression and the score of the comparison against slower ways to the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.special import ndtri

from lugrectl.identification.regression.numbers import ALPHA, FREEDOM
from lugrectl.identification.regression.robust_regression import Scale, bounded, solve
from lugrectl.identification.regression.score import (
    Blocks,
    density,
    left_out,
    losses,
    paired,
    seen,
)


def problem(seed: int, columns: int = 7) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((60, columns)) @ rng.standard_normal((columns, columns))
    y = X @ rng.standard_normal(columns) + 0.3 * rng.standard_normal(60)
    low = np.where(rng.random(columns) < 0.5, 0.0, -np.inf)
    high = np.where(rng.random(columns) < 0.3, 0.4, np.inf)
    return X, y, low, high


@pytest.mark.parametrize("seed", range(8))
def test_bounded_finds_the_least_squares_within_the_bounds(seed: int) -> None:
    X, y, low, high = problem(seed)
    b, state = bounded(X.T @ X, X.T @ y, low, high)
    want = lsq_linear(X, y, (low, high), tol=1e-14).x
    np.testing.assert_allclose(b, want, rtol=1e-5, atol=1e-6)
    assert np.all(b[state < 0] == low[state < 0]) and np.all(b[state > 0] == high[state > 0])


@pytest.mark.parametrize("seed", range(8))
def test_bounded_does_not_depend_on_the_states_from_which_it_starts(seed: int) -> None:
    X, y, low, high = problem(seed)
    b, state = bounded(X.T @ X, X.T @ y, low, high)
    wrong = np.where(np.isfinite(low), -1, np.where(np.isfinite(high), 1, 0))
    again, there = bounded(X.T @ X, X.T @ y, low, high, wrong)
    np.testing.assert_allclose(again, b, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(there, state)


def test_a_matrix_from_which_noise_was_taken_off_is_solved_as_well() -> None:
    G, g = np.array([[-1.0, 0.5], [0.5, 2.0]]), np.array([1.0, 1.0])
    b, _ = bounded(G, g, np.full(2, -np.inf), np.full(2, np.inf))
    np.testing.assert_allclose(G @ b, g)


def _rows(seed: int) -> tuple[np.ndarray, np.ndarray, Blocks]:
    rng = np.random.default_rng(seed)
    t = np.sort(rng.choice(np.arange(3000), 1500, replace=False)) * 1e-3
    t = t[(t < 1.0) | (t > 1.5)]  # some blocks have no rows
    X = rng.standard_normal((len(t), 4))
    y = X @ np.array([1.0, 2.0, 0.5, -1.0]) + 0.1 * rng.standard_t(FREEDOM, len(t))
    return X, y, Blocks.of(t, 3.0, 0.2)


def test_left_out_is_the_density_of_each_block_under_a_fit_without_it() -> None:
    X, y, blocks = _rows(1)
    free, scale = np.full(4, np.inf), Scale(0.1, 0.0)
    made = solve(X, y, np.zeros(4), -free, free, scale, rounds=60)
    found = left_out(made, X, np.zeros(4), scale, blocks, 1.0)
    inside = seen(made, blocks, 1.0)
    want = np.zeros(len(blocks))
    for i, (a, b) in enumerate(zip(blocks.cuts[:-1], blocks.cuts[1:], strict=True)):
        if b > a:
            keep = np.r_[0:a, b : len(y)]
            other = solve(X[keep], y[keep], np.zeros(4), -free, free, scale, rounds=60)
            want[i] = density((y[a:b] - X[a:b] @ other.b) / 0.1).sum()
    error = np.abs(found - want)[inside != want]
    assert error.max() < 0.4 * np.abs(inside - want).max()
    assert abs(found.sum() - want.sum()) < 0.4 * abs((inside - want).sum())


def test_blocks_of_a_short_record_are_no_shorter_than_what_shares_noise() -> None:
    t = np.linspace(0.0, 0.5, 100)
    assert len(Blocks.of(t, 0.5, 0.1)) == 5 and len(Blocks.of(t, 0.5, 0.3)) == 2


@pytest.mark.parametrize(("blocks", "sure"), [(2, False), (6, False), (7, True), (40, True)])
def test_blocks_that_agree_are_as_sure_as_coins_that_fall_alike(blocks: int, sure: bool) -> None:
    d = np.geomspace(40.0, 400.0, blocks)  # as they are, too uneven to be sure
    gain, se = paired(d, np.zeros(blocks))
    assert (gain > ndtri(1.0 - ALPHA) * se) == sure
    assert paired(-d, np.zeros(blocks)) == pytest.approx((-gain, se))


def test_one_block_says_nothing_of_its_own_error() -> None:
    assert paired(np.full(3, 9.0), np.zeros(3), together=3) == (27.0, np.inf)


def test_what_few_blocks_lose_counts_too() -> None:
    assert losses(np.array([-3.0, 5.0, -4.0])) == pytest.approx(5.0 * np.sqrt(2.0))


def test_a_block_without_rows_counts_nothing() -> None:
    X, y, blocks = _rows(2)
    free, scale = np.full(4, np.inf), Scale(0.1, 0.0)
    made = solve(X, y, np.zeros(4), -free, free, scale)
    empty = np.diff(blocks.cuts) == 0
    assert empty.any()
    assert np.all(left_out(made, X, np.zeros(4), scale, blocks, 1.0)[empty] == 0.0)
    assert np.all(seen(made, blocks, 1.0)[empty] == 0.0)


def test_that_few_blocks_gain_the_same_is_no_proof():
    """Two or three that agree to a percent may do so by chance; four that agree decide."""
    sure = {n: float(np.divide(*paired(300.0 + np.arange(n), np.zeros(n)))) for n in (2, 3, 4)}
    assert sure[2] < 1.0 and sure[3] < 2.33 < sure[4]
