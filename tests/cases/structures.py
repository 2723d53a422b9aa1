"""Flexible structures of many modes."""

from __future__ import annotations

import control as ct
import numpy as np


def structure(modes, through=0.01, *, turned=False, displacement=False, seed=0, high=1e3):
    """From force to speed (or displacement) of one point, 1 % damping."""
    rng = np.random.default_rng(seed)
    w, b = np.geomspace(1, high, modes), 0.5 + rng.random(modes)
    A, B, C = np.zeros((2 * modes, 2 * modes)), np.zeros((2 * modes, 1)), np.zeros((1, 2 * modes))
    for i in range(modes):
        A[2 * i, 2 * i + 1] = 1
        A[2 * i + 1, 2 * i : 2 * i + 2] = -(w[i] ** 2), -0.02 * w[i]
        B[2 * i + 1, 0] = b[i]
        C[0, 2 * i + (not displacement)] = b[i]
    if turned:
        Q, _ = np.linalg.qr(rng.standard_normal((2 * modes, 2 * modes)))
        A, B, C = Q @ A @ Q.T, Q @ B, C @ Q.T
    return ct.ss(A, B, C, [[through]])
