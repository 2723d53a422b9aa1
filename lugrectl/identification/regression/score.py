"""The score of a row of the table: how well it predicts blocks that it has not seen.

The influence function gives the fit without a block, d_b = -(H - H_b)^-1 s_b; the density of the
block under that fit is then exact. It is the density of the motion given the torque, so that the
residual counts over the inertia: what imitates u takes the inertia away and gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import ndtri, stdtrit

from .numbers import ALPHA, TRUSTED, UNLIKE
from .robust_regression import Scale, Solution, density, weights

CLIPS = (3.0, 10.0, 30.0)  # nats at which differences of blocks are cut: how many, not how much


@dataclass(frozen=True, eq=False)
class Blocks:
    """The parts of the rows, in order: ``cuts`` are their ends."""

    cuts: np.ndarray

    @classmethod
    def of(cls, t: np.ndarray, duration: float, length: float) -> Blocks:
        """Blocks of at least ``length`` s over rows at the times t: shorter ones share noise and
        would count one piece of a short record several times."""
        many = max(2, int(duration / length))
        which = np.minimum((t / duration * many).astype(int), many - 1)
        return cls(np.searchsorted(which, np.arange(many + 1)))

    def __len__(self) -> int:
        return len(self.cuts) - 1

    @cached_property
    def full(self) -> np.ndarray:
        """The blocks that have rows."""
        return np.flatnonzero(np.diff(self.cuts))

    @cached_property
    def places(self) -> np.ndarray:
        """The rows of each full block, (full blocks, most rows); m beyond its end."""
        first, many = self.cuts[self.full], np.diff(self.cuts)[self.full]
        each = np.arange(many.max(initial=0))
        return np.where(each < many[:, None], first[:, None] + each, self.cuts[-1])

    def apart(self, x: np.ndarray) -> np.ndarray:
        """Rows (m, ...) block by block, (full blocks, most rows, ...), with 0 in place of none."""
        return np.concatenate([x, np.zeros((1, *x.shape[1:]))])[self.places]

    def sums(self, x: np.ndarray) -> np.ndarray:
        """The sum over each block (blocks,), 0 of none."""
        return np.add.reduceat(np.append(x, 0.0), self.cuts[:-1]) * (np.diff(self.cuts) > 0)


def left_out(
    made: Solution,
    X: np.ndarray,
    prior: np.ndarray,
    scale: Scale,
    blocks: Blocks,
    factor: float,
) -> np.ndarray:
    """The log density of each block under the fit without it, (blocks,).

    With A the weighted rows of a block, A (H - A'A)^-1 A' = (1 - P)^-1 P, P = A H^-1 A': a system
    of the rows of a block in place of one of all coefficients (Sherman, Morrison, Woodbury).
    """
    Z, root = X[:, made.free], np.sqrt(made.weight)
    A = Z * (root / scale.sigma)[:, None]
    H = A.T @ A
    _with_prior(H, prior[made.free])
    pull = weights(made.r) * made.r / root
    try:
        T = blocks.apart(solve_triangular(np.linalg.cholesky(H), A.T, lower=True).T)
        P = T @ T.transpose(0, 2, 1)
        q = P @ blocks.apart(pull)[:, :, None]
        change = np.linalg.solve(np.eye(P.shape[1]) - P, q)[:, :, 0]
    except np.linalg.LinAlgError:
        return seen(made, blocks, factor)
    back = change[blocks.places < blocks.cuts[-1]] / root
    return blocks.sums(density(factor * (made.r + back)))


def _with_prior(H: np.ndarray, prior: np.ndarray) -> None:
    """Add the precision of the prior to the moments of the rows, and what makes them definite."""
    size = np.diag(H).copy()
    floor = size.max(initial=0.0) * (size < 1e-24 * size.max(initial=0.0))
    H[np.diag_indices(len(H))] += prior + 1e-9 * size + floor


def moves(
    made: Solution, X: np.ndarray, prior: np.ndarray, scale: Scale, blocks: Blocks
) -> np.ndarray:
    """How the free coefficients move when a block is left out, (full blocks, free)."""
    on, r = made.free, made.r
    Z, pull = X[:, on], weights(r) * r / scale.sigma
    each = blocks.apart(Z * (np.sqrt(made.weight) / scale.sigma)[:, None])
    own = each.transpose(0, 2, 1) @ each
    H = own.sum(axis=0)
    _with_prior(H, prior[on])
    slopes = np.add.reduceat(Z * pull[:, None], blocks.cuts[blocks.full])
    try:
        return -np.linalg.solve(H - own, slopes[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        return np.zeros_like(slopes)


def seen(made: Solution, blocks: Blocks, factor: float) -> np.ndarray:
    """The log density of each block under the fit to all, (blocks,): for screening."""
    return blocks.sums(density(factor * made.r))


def paired(a: np.ndarray, b: np.ndarray, together: int = 1) -> tuple[float, float]:
    """Difference of two scores and its standard error over paired blocks.

    ``together``: so many blocks in a row count as one.

    Differences count as they are or cut at a few nats, whichever is surer: what matters is how
    many blocks show an effect, not how much one of them shows. Blocks that all agree are as sure as
    so many coins that fall alike, and one block says nothing of its own error. That few blocks
    gain the same is chance: gains are as unlike as motions are.
    """
    d = a - b
    d = np.append(d, np.zeros(-len(d) % together)).reshape(-1, together).sum(axis=1)
    total, seen = float(d.sum()), np.count_nonzero(d)
    if len(d) < 2:
        return total, np.inf
    se, most = standard_error(d), _agreed(seen)
    se = max(se, UNLIKE * abs(total) / np.sqrt(max(seen, 1)))
    for clip in CLIPS:
        cut = np.clip(d, -clip, clip)
        z = float(cut.sum() / (np.sqrt(len(d)) * cut.std(ddof=1) + 1e-9))
        z = max(-most, min(z, most))
        if z * np.sign(total) > abs(total) / se:
            se = abs(total) / abs(z)
    return total, se * _widened(seen)


def standard_error(d: np.ndarray) -> float:
    """That of the sum of paired differences (blocks,), as they are: what a table shows.

    :func:`paired` decides; where every block agrees, its cut differences leave no error to show.
    """
    return float(np.sqrt(len(d)) * d.std(ddof=1)) + 1e-9


def losses(d: np.ndarray) -> float:
    """What chance gives and takes, from groups of blocks that are predicted worse.

    What a law of friction does not have lasts for a stroke: neighbouring blocks lose together. An
    effect that acts in a part of the record only gains there and loses nowhere.
    """
    most, many = 0.0, 1
    while many == 1 or len(d) >= TRUSTED * many:
        sums = np.append(d, np.zeros(-len(d) % many)).reshape(-1, many).sum(axis=1)
        most = max(most, float(np.sqrt(2.0 * np.sum(np.minimum(sums, 0.0) ** 2))))
        many *= 2
    return most


@cache
def _agreed(blocks: int) -> float:
    """Standard errors, once they are widened, that so many blocks reach if all have one sign."""
    return float(-ndtri(max(0.5**blocks, 1e-300))) * _widened(blocks)


@cache
def _widened(blocks: int) -> float:
    """How much wider a one-sided interval is for the few blocks from which its error is known."""
    return float(stdtrit(max(blocks - 1, 1), 1.0 - ALPHA) / ndtri(1.0 - ALPHA))
