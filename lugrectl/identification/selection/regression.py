"""The robust regression of all rows of the table.

Minimises the Student-t likelihood of r = y - X b with a Gaussian prior and bounds on b. The noise
of the acceleration (the first column) is taken off its moment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .numbers import FREEDOM

MOST_NOISE = 0.3  # of the moment of the acceleration that noise may take
ROUNDS = 40  # of the active set


@dataclass(frozen=True, eq=False)
class Scale:
    """Standard deviation of the rows, and the noise variance of their acceleration."""

    sigma: float
    noise: float


@dataclass(frozen=True, eq=False)
class Solution:
    """Coefficients b, residuals r over sigma, which of b are free, Student weights."""

    b: np.ndarray
    r: np.ndarray
    free: np.ndarray
    weight: np.ndarray


def solve(
    X: np.ndarray,
    y: np.ndarray,
    prior: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    scale: Scale,
    weight: np.ndarray | None = None,
    rounds: int = 5,
) -> Solution:
    """The coefficients; ``prior`` are precisions, ``weight`` those of a fit nearby."""
    w = np.ones(len(y)) if weight is None else weight
    b = r = np.zeros(0)
    free = np.ones(X.shape[1], bool)
    for _ in range(rounds):
        G, g = normal(X, y, prior, scale, w)
        b, free = bounded(G, g, low, high)
        r = (y - X @ b) / scale.sigma
        w = (FREEDOM + 1) / (FREEDOM + r * r)
    return Solution(b, r, free, w)


def normal(
    X: np.ndarray, y: np.ndarray, prior: np.ndarray, scale: Scale, w: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The normal equations, with prior, without the noise of the acceleration."""
    XW = X * w[:, None]
    G, g = XW.T @ X, XW.T @ y
    own = np.diag(G).copy()
    G[0, 0] -= min(scale.noise * w.sum(), MOST_NOISE * own[0])
    floor = 1e-18 * own.max() * (own < 1e-24 * own.max())
    G[np.diag_indices(len(own))] += prior * scale.sigma**2 + 1e-12 * own + floor
    return G, g


def bounded(
    G: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The b within its bounds that minimises b'Gb/2 - g'b, and which of it are at no bound."""
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    state = np.zeros(len(g), int)  # -1 at the low bound, 1 at the high one
    again = np.zeros(len(g), bool)
    b = np.zeros(len(g))
    for _ in range(ROUNDS):
        free = state == 0
        b = np.where(state < 0, low, np.where(state > 0, high, 0.0))
        held = ~free
        right = g[free] - G[np.ix_(free, held)] @ b[held]
        b[free] = np.linalg.solve(G[np.ix_(free, free)], right)
        beyond = np.where(free, np.maximum(low - b, b - high) * size, 0.0)
        if beyond.max() > 0:
            i = int(np.argmax(beyond))
            state[i] = -1 if b[i] < low[i] else 1
            continue
        pull = (g - G @ b) / size * -state  # towards the inside
        pull[free | again] = 0.0
        i = int(np.argmax(pull))
        if pull[i] <= 1e-9 * np.abs(g / size).max():
            break
        state[i], again[i] = 0, True
    return b, state == 0
