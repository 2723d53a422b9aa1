"""The robust regression of all rows of the table.

Minimises the Student-t likelihood of r = y - X b with a Gaussian prior and bounds on b. The noise
of the acceleration (the first column) is taken off its moment.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs

from .numbers import FREEDOM

MOST_NOISE = 0.3  # of the moment of the acceleration that noise may take
ROUNDS = 40  # of the active set
_POSV: Callable[..., Any] = get_lapack_funcs(("posv",), dtype=np.float64)[0]


@dataclass(frozen=True, eq=False)
class Scale:
    """Standard deviation of the rows, and the noise variance of their acceleration."""

    sigma: float
    noise: float


@dataclass(frozen=True, eq=False)
class Solution:
    """Coefficients b, residuals r over sigma, where b is at its bounds, Student weights."""

    b: np.ndarray
    r: np.ndarray
    state: np.ndarray
    weight: np.ndarray

    @property
    def free(self) -> np.ndarray:
        """Which of b are at no bound."""
        return self.state == 0


def solve(
    X: np.ndarray,
    y: np.ndarray,
    prior: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    scale: Scale,
    weight: np.ndarray | None = None,
    rounds: int = 5,
    near: np.ndarray | None = None,
) -> Solution:
    """The coefficients; ``prior`` are precisions, ``weight`` and ``near`` are the weights and the
    states of the first columns of a fit nearby."""
    w = np.ones(len(y)) if weight is None else weight
    b = r = np.zeros(0)
    state = np.zeros(X.shape[1], int)
    if near is not None:
        state[: len(near)] = near
        bound = np.where(state < 0, low, high)
        state[~np.isfinite(bound)] = 0
    for _ in range(rounds):
        G, g = normal(X, y, prior, scale, w)
        b, state = bounded(G, g, low, high, state)
        r = (y - X @ b) / scale.sigma
        w = weights(r)
    return Solution(b, r, state, w)


def weights(r: np.ndarray) -> np.ndarray:
    """Student weights (nu + 1) / (nu + r^2) of residuals in standard deviations."""
    return (FREEDOM + 1) / (FREEDOM + r * r)


def density(r: np.ndarray) -> np.ndarray:
    """Log of the Student density of residuals in standard deviations, up to a constant."""
    return -0.5 * (FREEDOM + 1) * np.log1p(r * r / FREEDOM)


def likelihood(r: np.ndarray) -> float:
    """The sum of their log densities."""
    return float(np.sum(density(r)))


def normal(
    X: np.ndarray, y: np.ndarray, prior: np.ndarray, scale: Scale, w: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The normal equations, with prior, without the noise of the acceleration."""
    root = np.sqrt(w)
    half = X * root[:, None]  # a product with its own transpose takes half the time
    G, g = half.T @ half, half.T @ (y * root)
    own = np.diag(G).copy()
    G[0, 0] -= min(scale.noise * w.sum(), MOST_NOISE * own[0])
    floor = 1e-18 * own.max() * (own < 1e-24 * own.max())
    G[np.diag_indices(len(own))] += prior * scale.sigma**2 + 1e-12 * own + floor
    return G, g


def bounded(
    G: np.ndarray,
    g: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    state: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The b within its bounds that minimises b'Gb/2 - g'b, and where it is at them.

    ``state`` is -1 at the low bound, 1 at the high one, 0 between: at the beginning that of a
    problem nearby. One column at a time goes to a bound or leaves it, until none has to. None
    leaves twice: if that ends too early, it begins again with all between.
    """
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    begun = state is not None and state.any()
    state = np.zeros(len(g), int) if state is None else state.copy()
    again = np.zeros(len(g), bool)
    near = 1e-9 * np.abs(g / size).max()
    b = np.zeros(len(g))
    for _ in range(ROUNDS):
        b = _between(G, g, np.where(state < 0, low, high), state)
        beyond = np.where(state == 0, np.maximum(low - b, b - high) * size, 0.0)
        i = int(beyond.argmax())
        if beyond[i] > 0:
            state[i] = -1 if b[i] < low[i] else 1
            continue
        if not state.any():
            break
        pull = (g - G @ b) / size * -state  # towards the inside
        i = int(np.where(again, 0.0, pull).argmax())
        if again[i] or pull[i] <= near:
            return bounded(G, g, low, high) if begun and pull.max() > near else (b, state)
        state[i], again[i] = 0, True
    return b, state


def _between(G: np.ndarray, g: np.ndarray, bound: np.ndarray, state: np.ndarray) -> np.ndarray:
    """The best b whose columns are at their bounds where ``state`` says so."""
    if not state.any():
        return _solved(G, g)
    on, held = np.flatnonzero(state == 0), np.flatnonzero(state)
    b = np.zeros(len(g))
    b[held] = bound[held]
    rows = G[on]
    b[on] = _solved(rows[:, on], g[on] - rows[:, held] @ b[held])
    return b


def _solved(G: np.ndarray, g: np.ndarray) -> np.ndarray:
    """By Cholesky; noise taken off a moment may leave no positive definite matrix."""
    if not len(g):
        return g
    _, b, failed = _POSV(G, g)
    return np.linalg.solve(G, g) if failed else b
