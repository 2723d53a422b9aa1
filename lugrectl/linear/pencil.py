"""The zeros of a state-space system in floating point, as eigenvalues of a pencil."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from scipy.linalg import eig, get_lapack_funcs, matrix_balance

from ..core.errors import InputError

EPS = 8 * np.finfo(float).eps  # of the norm of A: rounding that turning the coordinates leaves
LARGEST = 1e140  # its square, and that of its inverse, are floats

_trtrs: Any = get_lapack_funcs("trtrs", dtype=complex)  # without the checks of solve_triangular


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


def balanced(A: Any, B: Any, C: Any, D: Any) -> tuple[np.ndarray, ...]:
    """In units of the states that make rows and columns of A alike: powers of two, exactly."""
    if not (len(A) and all(np.isfinite(M).all() for M in (A, B, C, D))):
        require_sizes(A, B, C, D)
        return A, B, C, D
    found: Any = matrix_balance(A, permute=False, separate=True)
    A, (units, _) = found
    B, C = B / units[:, None], C * units
    if (b := float(np.abs(B).max(initial=0.0))) and (c := float(np.abs(C).max(initial=0.0))):
        gain = 2.0 ** round(0.5 * (math.log2(c) - math.log2(b)))
        B, C = B * gain, C / gain
    require_sizes(A, B, C, D)
    return A, B, C, D


def solve_shifted(
    S: np.ndarray, b: np.ndarray, s: complex, transposed: bool = False
) -> np.ndarray | None:
    """(s I - S)^-1 b of an upper triangle S, or of its transpose; None where that is singular."""
    M = -S
    np.fill_diagonal(M, M.diagonal() + s)
    found, singular = _trtrs(M, b, trans=int(transposed))
    return None if singular else found


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
