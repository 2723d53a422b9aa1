"""One quadratic function for several error systems, and the decay that it guarantees for all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize

ROUNDS = 3  # searches, each from the best so far
LEAST = 1e-9  # of the fastest rate: below it no decay is claimed


def common_rate(corners: Sequence[np.ndarray]) -> tuple[float, np.ndarray] | None:
    """The largest r found with A'P + P A + 2 r P <= 0 for all A of ``corners``, and P.

    If the error system is affine in quantities that move inside a box, its corners decide, and
    V = x'P x decays as V(t) <= V(0) exp(-2 r t) however these quantities move. None where no such
    P was found; this does not show that there is none.

    Parameters
    ----------
    corners : sequence of (n, n) ndarray
        Scale the states so that the entries of each matrix have about one size.

    Notes
    -----
    P = L L' with L triangular; r(P) = -max eig(L^-1 (A'P + P A) L'^-1)/2 is searched for by the
    method of Nelder and Mead. Every r that is found is a bound, the best one or not.
    """
    size = max(float(np.abs(A).max()) for A in corners)
    scaled = [A / size for A in corners]
    best, P = -np.inf, np.eye(len(corners[0]))
    for start in _starts(scaled):
        rate, made = _improved(scaled, start)
        if rate > best:
            best, P = rate, made
    return (best * size, P) if best > LEAST else None


def decay(P: np.ndarray, corners: Sequence[np.ndarray]) -> float:
    """The largest r with A'P + P A + 2 r P <= 0 for all corners."""
    L = np.linalg.cholesky(P)
    inverse = np.linalg.inv(L)
    worst = (inverse @ (A.T @ P + P @ A) @ inverse.T for A in corners)
    return -0.5 * max(float(np.linalg.eigvalsh(0.5 * (M + M.T))[-1]) for M in worst)


def _starts(corners: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Functions of single corners and of their mean, where these are stable."""
    n = len(corners[0])
    starts: list[np.ndarray] = [np.eye(n)]
    for A in (np.mean(corners, axis=0), *corners):
        slowest = float(np.linalg.eigvals(A).real.max())
        if slowest < -LEAST:
            shifted = A - 0.8 * slowest * np.eye(n)
            starts.append(np.asarray(solve_continuous_lyapunov(shifted.T, -np.eye(n))))
    return [P / np.trace(P) for P in starts]


def _improved(corners: Sequence[np.ndarray], P: np.ndarray) -> tuple[float, np.ndarray]:
    lower = np.tril_indices(len(P))

    def matrix(x: np.ndarray) -> np.ndarray:
        L = np.zeros_like(P)
        L[lower] = x
        return L @ L.T + 1e-12 * np.eye(len(P))

    def missed(x: np.ndarray) -> float:
        try:
            return -decay(matrix(x), corners)
        except np.linalg.LinAlgError:
            return np.inf

    x = np.linalg.cholesky(P)[lower]
    for _ in range(ROUNDS):
        x = minimize(missed, x, method="Nelder-Mead", options={"maxiter": 600}).x
    made = matrix(x)
    return -missed(x), made / np.trace(made)
