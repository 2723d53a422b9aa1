"""The covariance of a regression: leave one block out, for blocks of several lengths."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from .constants import (
    BLOCKS,
    FEW,
    LITTLE,
    LONGEST_MEMORY,
    PARTS,
    WHOLLY,
)
from .regression import Problem, Solution

Blocks = np.ndarray  # (n,) index of the block of each window


def blocks(piece: np.ndarray, run: np.ndarray, r: np.ndarray) -> list[Blocks]:
    """Blocks of 4, 8 and 16 memories of the residual, and whole runs where there are many."""
    forgotten, longest, made = memory(r), max(len(r) / PARTS, 2), []
    for factor in BLOCKS:
        cut = _cut(piece, int(np.clip(factor * forgotten, FEW, longest)))
        if not made or cut[-1] < made[-1][-1]:
            made.append(cut)
    runs = np.unique(run, return_inverse=True)[1]
    if FEW <= runs.max() + 1 < made[0].max() + 1:
        made.append(runs)
    return made


def coherent(variables: Sequence[np.ndarray]) -> list[Blocks]:
    """Blocks of windows with nearly the same value of a variable: speed, torque, position.

    A misfit that depends on such a variable comes again each time, however far apart in time.
    """
    found = []
    for x in variables:
        count = min(PARTS, len(x) // FEW)
        if count > 1 and np.ptp(x) > 0:
            rank = np.argsort(np.argsort(x, kind="stable"))
            found.append(rank * count // len(x))
    return found


def memory(r: np.ndarray) -> int:
    """Windows after which the residual has forgotten itself."""
    x, n = r - r.mean(), len(r)
    least = LITTLE * (x @ x / n + 1e-300)
    longest = max(min(n // 4, LONGEST_MEMORY), 2) - 1
    lags = range(1, longest + 1)
    return next((i for i in lags if x[: n - i] @ x[i:] < least * (n - i)), longest)


def _cut(piece: np.ndarray, size: int) -> Blocks:
    """Every piece in equal blocks of about ``size`` windows."""
    block, start = np.zeros(len(piece), int), 0
    for q in np.unique(piece):
        at = np.flatnonzero(piece == q)
        count = max(1, len(at) // size)
        block[at] = start + np.arange(len(at)) * count // len(at)
        start += count
    return block


def covariance(
    problem: Problem, fit: Solution, chunks: Sequence[Blocks], alike: Sequence[Blocks] = ()
) -> np.ndarray:
    """(m, m): by blocks in time, by those of :func:`coherent` (``alike``), and what only the prior
    says. The widest counts in every direction: V + positive part of (V' - V)."""
    W = fit.t / fit.variance
    inverse = np.linalg.inv(fit.A)
    score = problem.X * (W * fit.r)[:, None] + np.outer(W / W.sum(), fit.N @ fit.p - fit.c)
    V = None
    for block, power in [(b, 1.0) for b in chunks] + [(b, 0.5) for b in alike]:
        own = _without_each(problem.X, W, score, fit, block, power)
        if V is not None:  # usual variances for terms of which V knows all
            s = np.sqrt(np.maximum(np.diag(V), 1e-12 * np.diag(inverse)))
            share, E = np.linalg.eigh((own - V) / np.outer(s, s))
            own = V + np.outer(s, s) * ((E * np.maximum(share, 0)) @ E.T)
        V = own
    assert V is not None
    return V + inverse @ np.diag(fit.P) @ inverse


def _without_each(
    X: np.ndarray, W: np.ndarray, score: np.ndarray, fit: Solution, block: Blocks, power: float
) -> np.ndarray:
    """Sum over blocks b of d_b d_b', d_b = (1 - Q_b)^-power score_b, Q_b = X_b' W X_b - N_b.

    That is in coordinates with A = 1; N_b is the share of a block in N. A power of 1 is the
    jackknife, 1/2 is unbiased for errors that are independent. Where a block carries almost all
    that is known of a direction, leaving it out leaves nothing; the share that it carries is
    bounded.
    """
    if np.any(np.diff(block) < 0):
        order = np.argsort(block, kind="stable")
        X, W, score, block = X[order], W[order], score[order], block[order]
    first = np.flatnonzero(np.append(True, np.diff(block) > 0))
    edges = pairwise([*first.tolist(), len(block)])
    root = np.linalg.inv(np.linalg.cholesky(fit.A))  # root A root' = 1
    rows, N = (X * np.sqrt(W)[:, None]) @ root.T, root @ fit.N @ root.T
    weight = np.add.reduceat(W, first) / W.sum()
    Q = np.array([rows[a:b].T @ rows[a:b] for a, b in edges]) - weight[:, None, None] * N
    d = np.add.reduceat(score, first) @ root.T
    if power == 1 and np.linalg.norm(Q, axis=(1, 2)).max() < WHOLLY:
        d = np.linalg.solve(np.eye(len(N)) - Q, d[:, :, None])[:, :, 0]
    else:
        share, E = np.linalg.eigh(Q)
        gain = (1 - np.clip(share, 0, WHOLLY)) ** -power
        d = np.einsum("bij,bj->bi", E, np.einsum("bij,bi->bj", E, d) * gain)
    d = d @ root
    return d.T @ d * (len(first) - 1) / len(first)
