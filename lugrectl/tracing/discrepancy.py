"""What a torque that the model does not contain may do to the fitted values.

No model of a drive is complete. What stays unexplained is a smooth function of signals, the same in
every window, so that no scatter between windows shows how it biases a value. The innovations are

    r = A dx + v phi(theta, w, t, u) c + n,    c ~ N(0, lambda^2),

A their slopes by the coordinates x, v the response of the observer to a slow torque, phi a set of
smooth functions. Each set has the lambda that makes the innovations most likely. With H = A'A and
M = lambda^-2 + V'V - V'A H^-1 A'V, V = v phi, the covariance of x grows by H^-1 A'V M^-1 V'A H^-1,
and by the square of how far the values move beside the functions: they are one choice of many.

Source: Kennedy and O'Hagan, Bayesian calibration of computer models, J. R. Statist. Soc. B 63,
2001 (model discrepancy); the functions are those of the unknown torques of the comparison.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..identification.selection.unknown import of_law, of_motion, of_torque
from .beliefs import known, weak
from .fit import Fitted, inverse
from .slopes import slopes

BLOCK = 0.02  # s, over which functions of the signals change little
LEAST = 3.0  # gain in log-likelihood of functions that count
SIZES = (1e-2, 1e6, 60)  # of the coefficients, over what the best known of them is known to


@dataclass(frozen=True)
class _Moving:
    """Motion in the blocks, as the functions of an unknown torque read it."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    top: float
    motion: str


@dataclass(frozen=True)
class _Blocks:
    """Sums over blocks of samples, along the observer's response to a torque of 1.

    ``r`` (blocks,) of the innovations, ``A`` (coords, blocks) of their slopes, ``size`` (blocks,)
    of the squared response; ``samples`` (blocks, n) are their indices.
    """

    r: np.ndarray
    A: np.ndarray
    size: np.ndarray
    samples: np.ndarray


@dataclass(frozen=True)
class _Joint:
    """Coordinates and coefficients of functions together: their information and score.

    ``phi`` (blocks, k) are the functions so far.
    """

    information: np.ndarray
    score: np.ndarray
    phi: np.ndarray

    def beside(self, phi: np.ndarray, b: _Blocks) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of more functions: cross information with what is there, their own, their score."""
        weighted = b.size[:, None] * phi
        cross = np.vstack([b.A @ phi, self.phi.T @ weighted])
        return cross, phi.T @ weighted, phi.T @ b.r

    def with_functions(self, phi: np.ndarray, b: _Blocks, size: float) -> _Joint:
        """The same with more functions, whose coefficients have the size lambda."""
        cross, own, score = self.beside(phi, b)
        prior = np.eye(len(own)) / size**2
        return _Joint(
            np.block([[self.information, cross], [cross.T, own + prior]]),
            np.concatenate([self.score, score]),
            np.hstack([self.phi, phi]),
        )


def with_discrepancy(found: Fitted) -> Fitted:
    """The fit with what an unknown smooth torque adds to its covariance, ``discrepancy``."""
    if not found.free:
        return found
    b, k = _along_torque(found), len(found.free)
    believed = np.diag(weak(found.free)) + known(found.free, found.values, bounds=True)
    alone = _Joint(found.information + believed, found.scores.sum(0), np.empty((len(b.r), 0)))
    beside = _with_all(alone, b, list(_functions(found, b)))
    C, C0 = (inverse(joint.information)[:k] for joint in (beside, alone))
    shift = C @ beside.score - C0 @ alone.score
    return replace(found, discrepancy=C[:, :k] - C0 + np.outer(shift, shift))


def _with_all(joint: _Joint, b: _Blocks, sets: list[np.ndarray]) -> _Joint:
    """The joint fit with the sets of functions that make the innovations more likely, the best
    first."""
    while sets:
        found = [_most_likely(joint, phi, b) for phi in sets]
        best = max(range(len(sets)), key=lambda i: found[i][0])
        gain, size = found[best]
        if gain < LEAST:
            break
        joint = joint.with_functions(sets.pop(best), b, size)
    return joint


def _most_likely(joint: _Joint, phi: np.ndarray, b: _Blocks) -> tuple[float, float]:
    """The most likely size of the coefficients of functions, and the gain in log-likelihood."""
    cross, own, score = joint.beside(phi, b)
    moved = inverse(joint.information) @ np.column_stack([cross, joint.score])
    G, h = own - cross.T @ moved[:, :-1], score - cross.T @ moved[:, -1]
    d, Q = np.linalg.eigh(0.5 * (G + G.T))
    d, g = np.maximum(d, 0.0), Q.T @ h
    sizes = np.geomspace(*SIZES) / np.sqrt(max(d.max(), 1e-300))
    grown = sizes[:, None] ** 2
    gains = 0.5 * np.sum(g**2 * grown / (1 + grown * d) - np.log1p(grown * d), axis=1)
    best = int(np.argmax(gains))
    return float(gains[best]), float(sizes[best])


def _along_torque(found: Fitted) -> _Blocks:
    where, data = found.where, found.predictor.data
    r, A = slopes(found.predictor, found.values, found.free, where, found.noise)
    v = np.sqrt(data.weight[where.counted]) * _response(found)
    n = max(1, min(round(BLOCK / data.dt), where.length))
    each = where.length // n * n

    def summed(x: np.ndarray) -> np.ndarray:
        cut = x.sum(axis=-1)[..., :each]
        return cut.reshape(*cut.shape[:-2], -1, n).sum(axis=-1)

    samples = where.counted[:, :each].reshape(-1, n)
    return _Blocks(summed(r * v), summed(A * v), summed(v**2), samples)


def _response(found: Fitted) -> np.ndarray:
    """The whitened innovation (2,) that a constant torque of 1 leaves.

    The observer's error x~ of theta and w settles at x~ = F (1 - K C) x~ + (0, dt/J).
    """
    predictor, values = found.predictor, found.values
    gain, S = predictor.filter(found.noise, values)
    states, dt = predictor.lanes.states, predictor.data.dt
    K = gain[[states.index("theta"), states.index("w")]]
    C = np.diag(found.noise.channels().astype(float))
    F = np.array([[1.0, dt], [0.0, 1.0]])
    settled = np.linalg.pinv(np.eye(2) - F @ (np.eye(2) - K @ C)) @ [0.0, dt / values["J"]]
    return np.linalg.inv(np.linalg.cholesky(S)) @ C @ settled


def _functions(found: Fitted, b: _Blocks) -> Iterator[np.ndarray]:
    """Sets of smooth functions in the blocks, (blocks, k) each, of a size about 1 together."""
    log = found.predictor.data.log
    t, theta, w, u = (x[b.samples].mean(axis=1) for x in (log.t, log.theta, log.w, log.u))
    m = _Moving(t - t.min(), theta, w, log.fastest, log.motion)
    yield _rate(found, b)
    for made in (of_motion(m), of_law(m, np.sign(w)), of_torque(m, u)):
        for ways in made.values():
            for phi in ways:
                yield phi / (np.sqrt(np.mean(phi**2) * phi.shape[1]) + 1e-300)


def _rate(found: Fitted, b: _Blocks) -> np.ndarray:
    """What a torque that comes later by one sample changes, (blocks, 1), of size 1."""
    log = found.predictor.data.log
    slope = np.gradient(log.u)[b.samples].mean(axis=1)[:, None]
    return slope / (np.sqrt(np.mean(slope**2)) + 1e-300)
