"""The score of a row of the table: how well it predicts blocks that it has not seen.

The influence function gives the fit without a block, d_b = -(H - H_b)^-1 s_b; the density of the
block under that fit is then exact. It is the density of the motion given the torque, so that the
residual counts over the inertia: what imitates u takes the inertia away and gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .numbers import FREEDOM
from .regression import Scale, Solution

CLIPS = (3.0, 10.0, 30.0)  # nats at which differences of blocks are cut: how many, not how much


@dataclass(frozen=True, eq=False)
class Blocks:
    """The parts of the rows, in order: ``cuts`` are their ends."""

    cuts: np.ndarray

    @classmethod
    def of(cls, t: np.ndarray, duration: float, length: float) -> Blocks:
        """Blocks of about ``length`` s over rows at the times t."""
        many = max(12, int(duration / length))
        which = np.minimum((t / duration * many).astype(int), many - 1)
        return cls(np.searchsorted(which, np.arange(many + 1)))

    def __len__(self) -> int:
        return len(self.cuts) - 1

    @property
    def full(self) -> list[tuple[int, slice]]:
        """The blocks that have rows."""
        ends = zip(self.cuts[:-1].tolist(), self.cuts[1:].tolist(), strict=True)
        return [(i, slice(a, b)) for i, (a, b) in enumerate(ends) if b > a]


def density(r: np.ndarray, factor: float = 1.0) -> np.ndarray:
    """Log of the Student density of residuals in standard deviations, up to a constant."""
    return -0.5 * (FREEDOM + 1) * np.log1p((factor * r) ** 2 / FREEDOM)


def left_out(
    made: Solution,
    X: np.ndarray,
    prior: np.ndarray,
    scale: Scale,
    blocks: Blocks,
    factor: float,
) -> np.ndarray:
    """The log density of each block under the fit without it, (blocks,)."""
    out = np.zeros(len(blocks))
    Z, moved = X[:, made.free], moves(made, X, prior, scale, blocks)
    for (i, k), d in zip(blocks.full, moved, strict=True):
        out[i] = density(made.r[k] - Z[k] @ d / scale.sigma, factor).sum()
    return out


def moves(
    made: Solution, X: np.ndarray, prior: np.ndarray, scale: Scale, blocks: Blocks
) -> np.ndarray:
    """How the free coefficients move when a block is left out, (full blocks, free)."""
    on, r = made.free, made.r
    Z = X[:, on]
    ZW = Z * (made.weight / scale.sigma**2)[:, None]
    pull = (FREEDOM + 1) * r / (FREEDOM + r * r) / scale.sigma
    H = Z.T @ ZW
    own = np.diag(H).copy()
    floor = own.max() * (own < 1e-24 * own.max())
    H[np.diag_indices(len(H))] += prior[on] + 1e-9 * own + floor
    parts = [k for _, k in blocks.full]
    rest = np.stack([H - Z[k].T @ ZW[k] for k in parts])
    slopes = np.stack([Z[k].T @ pull[k] for k in parts])
    try:
        return -np.linalg.solve(rest, slopes[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        return np.zeros_like(slopes)


def seen(made: Solution, blocks: Blocks, factor: float) -> np.ndarray:
    """The log density of each block under the fit to all, (blocks,): for screening."""
    each = density(made.r, factor)
    return np.add.reduceat(np.append(each, 0.0), blocks.cuts[:-1]) * (np.diff(blocks.cuts) > 0)


def paired(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Difference of two scores and its standard error over paired blocks.

    Differences count as they are or cut at a few nats, whichever is surer: what matters is how
    many blocks show an effect, not how much one of them shows.
    """
    d = a - b
    total = float(d.sum())
    se = float(np.sqrt(len(d)) * d.std(ddof=1)) + 1e-9
    for clip in CLIPS:
        cut = np.clip(d, -clip, clip)
        z = float(cut.sum() / (np.sqrt(len(d)) * cut.std(ddof=1) + 1e-9))
        if z * np.sign(total) > abs(total) / se:
            se = abs(total) / abs(z)
    return total, se
