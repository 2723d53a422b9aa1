"""Friction torque over speed, in both directions."""

from __future__ import annotations

import numpy as np

from .constants import (
    BINS,
    FEW,
    LITTLE,
    PASSES,
    TOP,
)
from .fit import Fit
from .regression import deviation, student
from .result import CurvePoint


def curve(made: Fit) -> tuple[CurvePoint, ...]:
    """Robust means over bins of equal numbers of windows."""
    d, torque = made.windows, friction_torque(made)
    whole = np.abs(d.X[:, made.names.index("Fc")]) > TOP if "Fc" in made.names else True
    points = []
    for side in (-1, 1):
        at = np.flatnonzero((side * d.w > 0) & (d.rest < LITTLE) & whole)
        at = at[np.argsort(d.w[at])]
        if len(at) < FEW:
            continue
        for part in np.array_split(at, min(BINS, len(at) // FEW)):
            points.append(_point(d.w[part], torque[part], made.chunks[0][part], made.torque))
    return tuple(points)


def friction_torque(made: Fit) -> np.ndarray:
    """The torque of friction in each window (n,), N m, with what the fit leaves."""
    d, m = made.windows, len(made.terms)
    friction = np.array([term.friction for term in made.terms])
    torque = made.r + d.X[:, friction] @ made.p[:m][friction]
    columns = {"Fc": np.sign(d.w), "Fv": d.w, "constant_torque": 1.0}
    for key, value in made.setting.held:
        torque = torque + columns.get(key, 0.0) * value
    return torque


def _point(w: np.ndarray, torque: np.ndarray, block: np.ndarray, size: float) -> CurvePoint:
    mean = float(np.median(torque))
    scale = deviation(torque - mean) + 1e-12 * size
    for _ in range(PASSES):
        mean = float(np.average(torque, weights=student(torque - mean, scale**2)))
    half = 2 * scale / np.sqrt(max(len(np.unique(block)), 2))
    return CurvePoint(float(np.median(w)), mean, (mean - half, mean + half), len(w))
