"""The regression and the score of the comparison against slower ways to the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.special import ndtri

from lugrectl.core.regression import (
    NU,
    Blocks,
    Prior,
    bounded,
    log_density,
    paired,
    robust,
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
    b, free = bounded(X.T @ X, X.T @ y, low, high)
    want = lsq_linear(X, y, (low, high), tol=1e-14).x
    np.testing.assert_allclose(b, want, rtol=1e-5, atol=1e-6)
    assert np.all((b == low)[~free] | (b == high)[~free])
    wrong = np.isfinite(low) | np.isfinite(high)  # bounds that hold at the start
    again, there = bounded(X.T @ X, X.T @ y, low, high, wrong)
    np.testing.assert_allclose(again, b, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(there, free)


def test_a_matrix_from_which_noise_was_taken_off_is_solved_as_well() -> None:
    G, g = np.array([[-1.0, 0.5], [0.5, 2.0]]), np.array([1.0, 1.0])
    b, _ = bounded(G, g, np.full(2, -np.inf), np.full(2, np.inf))
    np.testing.assert_allclose(G @ b, g)


def rows(seed: int) -> tuple[np.ndarray, np.ndarray, Blocks]:
    rng = np.random.default_rng(seed)
    t = np.sort(rng.choice(np.arange(3000), 1500, replace=False)) * 1e-3
    t = t[(t < 1.0) | (t > 1.5)]  # some blocks have no rows
    X = rng.standard_normal((len(t), 4))
    y = X @ np.array([1.0, -0.5, 0.2, -1.0]) + 0.1 * rng.standard_t(NU, len(t))
    return X, y, Blocks(t, 3.0, 15)


def test_left_out_is_the_density_of_each_block_under_a_fit_without_it() -> None:
    X, y, blocks = rows(1)
    prior = Prior.free(4)
    made = robust(X, y, prior, 0.1, turns=60)
    found, inside = blocks.left_out(made, X, prior, 0.1, 1.0), blocks.seen(made.r, 1.0)
    want = np.zeros(blocks.number)
    for i, part in enumerate(blocks.parts):
        keep = np.r_[0 : part.start, part.stop : len(y)]
        other = robust(X[keep], y[keep], prior, 0.1, turns=60)
        want[i] = log_density((y[part] - X[part] @ other.b) / 0.1).sum()
    error = np.abs(found - want)[inside != want]
    assert error.max() < 0.4 * np.abs(inside - want).max()
    assert abs(found.sum() - want.sum()) < 0.4 * abs((inside - want).sum())


def test_one_block_that_gains_all_is_no_proof() -> None:
    sure, lucky = np.full(40, 1.0), np.r_[40.0, np.zeros(39)]
    sure = sure + 0.1 * np.random.default_rng(0).standard_normal(40)
    for d, proven in ((sure, True), (lucky, False)):
        gain, se = paired(d, np.zeros(40))
        assert (gain > ndtri(0.99) * se) == proven
        assert paired(-d, np.zeros(40)) == pytest.approx((-gain, se))
