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
    state = np.zeros(X.shape[1], int)
    for _ in range(rounds):
        G, g = normal(X, y, prior, scale, w)
        b, state = bounded(G, g, low, high, state)
        r = (y - X @ b) / scale.sigma
        w = (FREEDOM + 1) / (FREEDOM + r * r)
    return Solution(b, r, state == 0, w)


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
    problem nearby. A column enters or leaves the bounds one at a time, until none has to.
    """
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
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
        pull[again] = 0.0
        i = int(pull.argmax())
        if pull[i] <= near:
            break
        state[i], again[i] = 0, True
    return b, state


def _between(G: np.ndarray, g: np.ndarray, bound: np.ndarray, state: np.ndarray) -> np.ndarray:
    """The best b whose columns are at their bounds where ``state`` says so."""
    if not state.any():
        return np.linalg.solve(G, g)
    on, held = np.flatnonzero(state == 0), np.flatnonzero(state)
    b = np.zeros(len(g))
    b[held] = bound[held]
    rows = G[on]
    b[on] = np.linalg.solve(rows[:, on], g[on] - rows[:, held] @ b[held])
    return b
