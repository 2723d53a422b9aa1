"""The zeros of a state-space system in floating point, as eigenvalues of a pencil."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from scipy.linalg import eig

from ..core.errors import InputError

EPS = 8 * np.finfo(float).eps  # of the norm of A: rounding that turning the coordinates leaves
LARGEST = 1e140  # its square, and that of its inverse, are floats


def require_sizes(*matrices: np.ndarray) -> None:
    """InputError for matrices that floating point cannot multiply."""
    sizes = [float(np.abs(M).max(initial=0.0)) for M in matrices]
    if not all(map(math.isfinite, sizes)):
        raise InputError("an entry of the state-space matrices is not a finite number.")
    if far := [x for x in sizes if x and not 1 / LARGEST < x < LARGEST]:
        raise InputError(
            f"the state-space matrices hold numbers of {far[0]:.1g}, too far from 1 for floating "
            "point: give time, input or output in another unit."
        )


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
