"""The noise of a map without any model: how its points lie beside the lines through neighbours."""

from __future__ import annotations

import numpy as np


def noise_of(w: np.ndarray, u: np.ndarray) -> float | None:
    """Standard deviation of single points of a smooth curve, N m; None of fewer than three a way.

        e_i = u_i - a u_(i-1) - b u_(i+1),    v = mean e_i^2 / (1 + a^2 + b^2)

    with the line through the neighbours in speed, in each direction (Gasser, Sroka and
    Jennen-Steinmetz, Residual variance and residual pattern in nonlinear regression, Biometrika
    73(3), 1986). The scatter from run to run is in it, and what the curve bends between three
    points.
    """
    squares = [_squares(w[side], u[side]) for side in (w > 0.0, w < 0.0)]
    every = np.concatenate(squares)
    return float(np.sqrt(np.mean(every))) if len(every) else None


def _squares(w: np.ndarray, u: np.ndarray) -> np.ndarray:
    """e^2 / (1 + a^2 + b^2) of the points between two others."""
    order = np.argsort(w)
    w, u = w[order], u[order]
    apart = w[2:] - w[:-2]
    a = np.where(apart > 0.0, (w[2:] - w[1:-1]) / np.where(apart > 0.0, apart, 1.0), 0.5)
    e = u[1:-1] - a * u[:-2] - (1.0 - a) * u[2:]
    return e**2 / (1.0 + a**2 + (1.0 - a) ** 2)
