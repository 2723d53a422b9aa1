"""What a torque that the model does not contain may do to fitted values.

No model of a drive is complete. What stays unexplained is a smooth function of signals, the same
all along the record, so that no scatter between its parts shows how it biases a value. Residuals
are

    r = A dx + V c + n,    V = v phi(theta, w, t, u),    c ~ N(0, lambda^2),    n ~ N(0, 1),

A their slopes by the values x, v by a torque, phi sets of smooth functions. Each set has the lambda
that makes the residuals most likely. With H = A'A and M = lambda^-2 + V'V - V'A H^-1 A'V the
covariance of x grows by H^-1 A'V M^-1 V'A H^-1, and by the square of how far the values move
beside the functions: they are one choice of many.

Source: Kennedy and O'Hagan, Bayesian calibration of computer models, J. R. Statist. Soc. B 63,
2001 (model discrepancy).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from .smooth_functions import of_law, of_motion, of_torque

LEAST = 3.0  # gain in log-likelihood of functions that count
SAME = 1e-9  # of the information on functions: less is rounding
SIZES = (1e-2, 1e6, 60)  # of the coefficients, over what the best known of them is known to


@dataclass(frozen=True)
class Rows:
    """Sums over rows of a record: ``r`` (m,) is v r, ``A`` (k, m) v A, ``size`` (m,) v^2."""

    r: np.ndarray
    A: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class Motion:
    """The motion in the rows, as functions of signals read it."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    u: np.ndarray
    motion: str

    def functions(self) -> Iterator[np.ndarray]:
        """Sets of smooth functions, (m, k) each, and what a later torque changes."""
        yield np.gradient(self.u)[:, None]
        for made in (of_motion(self), of_law(self, np.sign(self.w)), of_torque(self, self.u)):
            for ways in made.values():
                yield from ways


def discrepancy(
    information: np.ndarray, score: np.ndarray, rows: Rows, sets: Iterable[np.ndarray]
) -> np.ndarray:
    """What an unknown smooth torque adds to the covariance of k values, (k, k).

    ``information`` (k, k) is A'A with the prior's, ``score`` (k,) A'r.
    """
    k = len(score)
    alone = _Joint(information, score, rows.A)
    beside = _with_all(alone, [_Set.of(phi, rows) for phi in map(_scaled, sets) if phi.size])
    C, C0 = (inverse(joint.information)[:k] for joint in (beside, alone))
    shift = C @ beside.score - C0 @ alone.score
    return C[:, :k] - C0 + np.outer(shift, shift)


def inverse(information: np.ndarray) -> np.ndarray:
    """Inverse along identified directions; 0 along the others."""
    unit, scale = unit_diagonal(information)
    return np.linalg.pinv(unit, rcond=1e-12, hermitian=True) / scale


def unit_diagonal(information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The matrix scaled to a unit diagonal, and by what it was divided."""
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scale = np.outer(size, size)
    return information / scale, scale


def _scaled(phi: np.ndarray) -> np.ndarray:
    """The functions at a size of 1 together."""
    return phi / (np.sqrt(np.mean(phi**2) * phi.shape[1]) + 1e-300) if phi.size else phi


@dataclass(frozen=True)
class _Set:
    """Functions phi (m, k) of an unknown torque, with their own information and score."""

    phi: np.ndarray
    weighted: np.ndarray
    information: np.ndarray
    score: np.ndarray

    @classmethod
    def of(cls, phi: np.ndarray, rows: Rows) -> _Set:
        weighted = rows.size[:, None] * phi
        return cls(phi, weighted, phi.T @ weighted, phi.T @ rows.r)


@dataclass(frozen=True)
class _Joint:
    """Values and coefficients of functions together: their information and score.

    ``slopes`` (k, m) are those of the values and of the functions so far.
    """

    information: np.ndarray
    score: np.ndarray
    slopes: np.ndarray

    def beside(self, more: _Set, size: float) -> _Joint:
        """The same with more functions, whose coefficients have the size lambda."""
        cross, prior = self.slopes @ more.phi, np.eye(len(more.score)) / size**2
        return _Joint(
            np.block([[self.information, cross], [cross.T, more.information + prior]]),
            np.concatenate([self.score, more.score]),
            np.vstack([self.slopes, more.weighted.T]),
        )


def _with_all(joint: _Joint, sets: list[_Set]) -> _Joint:
    """The joint fit with the sets that make the residuals more likely, the best first."""
    while sets:
        C = inverse(joint.information)
        found = [_most_likely(joint, C, one) for one in sets]
        best = max(range(len(sets)), key=lambda i: found[i][0])
        gain, size = found[best]
        if gain < LEAST:
            break
        joint = joint.beside(sets.pop(best), size)
    return joint


def _most_likely(joint: _Joint, C: np.ndarray, more: _Set) -> tuple[float, float]:
    """The gain in log-likelihood at the most likely size of the coefficients, and that size.

    ``C`` is the covariance of what is joined so far.
    """
    cross = joint.slopes @ more.phi
    moved = C @ np.column_stack([cross, joint.score])
    G, h = more.information - cross.T @ moved[:, :-1], more.score - cross.T @ moved[:, -1]
    d, Q = np.linalg.eigh(0.5 * (G + G.T))
    new = d > SAME * np.trace(more.information)  # the values imitate the others
    if not new.any():
        return 0.0, 0.0
    d, g = d[new], (Q.T @ h)[new]
    sizes = np.geomspace(*SIZES) / np.sqrt(d.max())
    grown = sizes[:, None] ** 2
    gains = 0.5 * np.sum(g**2 * grown / (1 + grown * d) - np.log1p(grown * d), axis=1)
    best = int(np.argmax(gains))
    return float(gains[best]), float(sizes[best])
