"""The score test: what small changes of the model would gain in likelihood."""

from __future__ import annotations

import numpy as np

from .fit import Fitted
from .likelihood import whitened
from .predictor import Predictor

LARGEST = 2_000_000  # counted samples in one engine call


class Score:
    """Gain in log-likelihood from small changes, the base model's own directions taken out."""

    def __init__(self, base: Fitted) -> None:
        self.base = base
        sets = [base.values]
        for c in base.free:
            moved = dict(base.values)
            moved[c.key] = c.back(c.into(base.values) + c.step, base.values)
            sets.append(moved)
        white = whitened(base.predictor, sets, base.where, base.noise)
        A = (white[0] - white[1:]).reshape(len(base.free), -1)
        size = np.linalg.norm(A, axis=1)
        A = A[size > 0] / size[size > 0, None]
        U, s, _ = np.linalg.svd(A.T, full_matrices=False)
        self.basis = U[:, s > 1e-8 * s[0]] if len(s) else U
        self.r = white[0].ravel()
        self.white = white[0]

    def gain(self, columns: np.ndarray) -> tuple[float, np.ndarray]:
        """Gain and coefficients for directions (k, n), each an innovation change per unit."""
        B = columns - (columns @ self.basis) @ self.basis.T
        H, g = B @ B.T, B @ self.r
        scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
        unit = H / np.outer(scale, scale) + 1e-9 * np.eye(len(H))
        c = np.linalg.solve(unit, g / scale) / scale
        return 0.5 * float(g @ c), c


def whitened_by_parts(predictor: Predictor, sets: list[dict], base: Fitted) -> np.ndarray:
    """In calls of bounded size, for the memory's sake."""
    most = max(1, LARGEST // max(1, base.where.counted.size))
    parts = [sets[i : i + most] for i in range(0, len(sets), most)]
    return np.concatenate([whitened(predictor, p, base.where, base.noise) for p in parts])
