"""Score (Lagrange multiplier) test: the gain in likelihood from small changes of the model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..spec import Block
from .data import Log
from .fit import Fitted, moved
from .likelihood import whitened
from .noise import NORMAL_MAD
from .predictor import Predictor, Values
from .series import run_alone

OUTLYING = 3.0  # usual sizes at which the weight of an innovation is one half
LARGEST = 2_000_000  # counted samples in one engine call
LONGEST = 4_000_000  # samples of its input series


class Score:
    """Gain in log-likelihood from small changes, with the base model's parameters as nuisance.

    A wrong model fails most around rest, in spikes that no small change explains. They would hide
    what happens between them, so innovations have robust (Cauchy) weights.
    """

    def __init__(self, base: Fitted) -> None:
        self.base = base
        sets = [base.values]
        for c in base.free:
            ahead = c.back(c.into(base.values) + c.step, base.values)
            sets.append(base.values | {c.key: ahead})
        white = whitened(base.predictor, sets, base.where, base.noise)
        self.white = white[0]
        self.root, self.count = weighing(white[0].ravel())
        self.r = self.root * white[0].ravel()
        A = self.root * (white[0] - white[1:]).reshape(len(base.free), -1)
        self.slopes = A / np.array([c.step for c in base.free])[:, None]
        size = np.linalg.norm(A, axis=1)
        A = A[size > 0] / size[size > 0, None]
        self.basis = orthonormal(A, 1e-8)
        self.rest = float(self.r @ self.r) - float(np.sum((self.r @ self.basis) ** 2))

    def followed(self, column: np.ndarray) -> dict[str, float]:
        """Values of the base model refitted beside a given change of the innovations: one step
        of least squares in its coordinates, in a logarithm at most a factor of two."""
        base = self.base
        if not len(self.slopes):
            return dict(base.values)
        size = np.maximum(np.linalg.norm(self.slopes, axis=1), 1e-300)
        left = self.r - self.root * column
        dx = np.linalg.lstsq((self.slopes / size[:, None]).T, left, rcond=1e-6)[0]
        return moved(base.values, base.free, dx / size)

    def gain(self, columns: np.ndarray) -> tuple[float, np.ndarray]:
        """Gain and coefficients for directions (k, n), each the change of innovations per unit.

        The noise level is refitted as well: -n/2 log(1 - R^2) rather than n R^2/2.
        """
        size = np.maximum(np.max(np.abs(columns), axis=1, keepdims=True), 1e-300)
        columns = self.root * (columns / size)  # an unstable plant responds with huge numbers
        B = columns - (columns @ self.basis) @ self.basis.T
        H, g = B @ B.T, B @ self.r
        scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
        unit = H / np.outer(scale, scale) + 1e-9 * np.eye(len(H))
        c = np.linalg.solve(unit, g / scale) / scale
        explained = min(float(g @ c) / max(self.rest, 1e-300), 1.0 - 1e-9)
        return -0.5 * self.count * float(np.log1p(-max(explained, 0.0))), c / size[:, 0]


def orthonormal(rows: np.ndarray, least: float = 1e-9) -> np.ndarray:
    """An orthonormal basis, as columns, of the span of the rows."""
    U, s, _ = np.linalg.svd(rows.T, full_matrices=False)
    return U[:, s > least * s[0]] if len(s) else U


def weighing(r: np.ndarray) -> tuple[np.ndarray, float]:
    """Square roots of the weights, and the number of samples they amount to."""
    size = np.abs(r[r != 0.0])
    if not len(size):
        return np.ones_like(r), 0.0
    usual = OUTLYING * float(np.median(size)) / NORMAL_MAD
    weights = 1.0 / (1.0 + (r / usual) ** 2)
    return np.sqrt(weights), float(np.sum(weights[r != 0.0]))


def at_once(samples: int) -> int:
    """Number of sets that may have series of that length in memory at the same time."""
    return max(1, LONGEST // samples)


def alone_by_parts(block: Block, log: Log, sets: Sequence[Values]) -> Iterator[np.ndarray]:
    """Output of a block with states along the log, in parts (some sets, samples) of bounded
    size."""
    most = at_once(len(log.t))
    for i in range(0, len(sets), most):
        yield run_alone(block, log, log.signals, sets[i : i + most])[..., 0]


def whitened_by_parts(
    predictor: Predictor, sets: Sequence[Values], base: Fitted, torque: np.ndarray | None = None
) -> np.ndarray:
    """Whitened innovations, in calls that limit the memory; ``torque`` (sets, N) resists."""
    fit_in = LARGEST // max(1, base.where.counted.size)
    most = max(1, min(fit_in, at_once(len(predictor.data.t))))
    parts = [slice(i, i + most) for i in range(0, len(sets), most)]
    made = [
        whitened(
            predictor, sets[p], base.where, base.noise, torque=None if torque is None else torque[p]
        )
        for p in parts
    ]
    return np.concatenate(made)
