"""What the friction of every machine may have beside the terms: too little to be a term of its own.

With columns Z of such effects, Z* what the terms X cannot explain of them, and the weights W, the
residual r and the matrix A of the regression,

    z = (Z*' W Z* + 1 / q^2)^-1 Z*' W r,    C = A^-1 X' W Z,

and the fit is off by C z. The record itself says how large these effects are on this machine: q is
the most likely factor of their usual sizes, by expectation and maximisation.
"""

from __future__ import annotations

import numpy as np

from .constants import LOADED, PASSES_OF_SIZE, SLOW_TURN, SLOW_TURNS
from .fit import Fit, independent
from .friction_shapes import Between
from .terms import Term
from .windows import Source

TORQUES = ("J", "Fc", "Fv", "constant_torque", "slope", "gravity.sin", "gravity.cos")


def allowance(source: Source, made: Fit) -> np.ndarray:
    """The mean of (C z)(C z)' over what z may be (m, m)."""
    Z = _columns(source, made)
    if Z is None:
        return np.zeros_like(made.V)
    fit, X = made.solution, made.problem.X
    W = (fit.t / fit.variance)[:, None]
    B = X.T @ (W * Z)
    C = np.linalg.solve(fit.A, B)
    own = Z - X @ np.linalg.solve(X.T @ (W * X) + np.diag(fit.P), B)
    S = own.T @ (W * own) / independent(made)
    score = own.T @ (W[:, 0] * fit.r) / independent(made)
    square, mean = np.eye(len(score)), 1.0
    for _ in range(PASSES_OF_SIZE):
        spread = np.linalg.inv(S + np.eye(len(score)) / mean)
        z = spread @ score
        square = np.outer(z, z) + spread
        mean = float(np.trace(square)) / len(score)
    return C @ square @ C.T


def _columns(source: Source, made: Fit) -> np.ndarray | None:
    """Friction that rises with the load, or turns over slowly, of usual size (n, effects)."""
    if "Fc" not in made.names:
        return None
    travel = max(float(np.ptp(np.cumsum(p.speed)) * p.dt) for p in source.tracks)
    turns = [Term(f"slow turn {x}", Between(0.0, x * travel)) for x in SLOW_TURNS]
    windows = source.windows(made.half_width, turns, made.setting.rest, made.windows.delay)
    if windows is None:
        return None
    d, at = made.windows, [i for i, name in enumerate(made.names) if name in TORQUES]
    load = np.abs(d.X[:, at] @ made.p[at]) * d.X[:, made.names.index("Fc")]
    return np.c_[LOADED * load, SLOW_TURN * made.problem.level * windows.X]
