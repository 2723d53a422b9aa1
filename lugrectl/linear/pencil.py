"""The zeros of a state-space system in floating point, as eigenvalues of a pencil."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from scipy.linalg import eig

EPS = 8 * np.finfo(float).eps  # of the norm of A: rounding that turning the coordinates leaves


def level_zeros(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, square: float
) -> np.ndarray:
    """The zeros of T(-s)^T T(s) - ``square`` I (Boyd, Balakrishnan and Kabamba 1989)."""
    return zeros_of(
        np.block([[A, np.zeros_like(A)], [-C.conj().T @ C, -A.conj().T]]),
        np.vstack([B, -C.conj().T @ D]),
        np.hstack([D.conj().T @ C, B.conj().T]),
        D.conj().T @ D - square * np.eye(B.shape[1]),
    )


def zeros_of(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: Any) -> np.ndarray:
    """The finite zeros of a system with as many inputs as outputs."""
    scale = math.sqrt(max(np.linalg.norm(B), 1e-300) / max(np.linalg.norm(C), 1e-300))
    left = np.block([[A, B / scale], [C * scale, np.atleast_2d(D)]])
    right = np.diag([*np.ones(len(A)), *np.zeros(len(C))])
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        pairs: Any = eig(left, right, right=False, homogeneous_eigvals=True)
    alpha, beta = pairs
    with np.errstate(all="ignore"):
        return (alpha / beta)[np.abs(beta) > 1e-14 * np.abs(alpha).max()]
