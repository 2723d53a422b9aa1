"""Smooth functions of the signals of a drive: what a torque without a name may depend on.

Splines and waves; sets of them, by the signals that they depend on.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

TURNS = 6.5  # rad of travel from which the place is an angle
FINE = 80  # functions of the place or of time, where it is narrow
RARE = 0.02  # a column that is 0 on all but this share of the rows is u itself on the others

Surfaces = dict[tuple[str, ...], list[np.ndarray]]


class Moving(Protocol):
    """Samples (n,) of a motion; ``motion`` is "rotary" or "linear"."""

    @property
    def t(self) -> np.ndarray: ...
    @property
    def theta(self) -> np.ndarray: ...
    @property
    def w(self) -> np.ndarray: ...
    @property
    def motion(self) -> str: ...


def _late(m: Moving) -> np.ndarray:
    """The time in [0, 1]."""
    return m.t / (float(np.max(m.t)) + 1e-300)


def _top(m: Moving) -> float:
    return float(np.quantile(np.abs(m.w), 0.99))


def _place(m: Moving) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """The place in [0, 1], and fine and coarse functions of it."""
    span = float(np.ptp(m.theta)) + 1e-12
    x = (m.theta - m.theta.min()) / span
    if span > TURNS and m.motion != "linear":
        return x, [_waves(m.theta, 12), spline(x, 16)], _waves(m.theta, 6)
    return x, [spline(x, 16)], spline(x, 8)


def _narrow(m: Moving) -> np.ndarray:
    """Functions of the place as narrow as a bump."""
    x, places, _ = _place(m)
    return _waves(m.theta, FINE // 2) if len(places) > 1 else spline(x, FINE)


def of_motion(m: Moving) -> Surfaces:
    """Functions of the place, of the speed, of the time, (n, k) each."""
    speed = np.abs(m.w / (_top(m) + 1e-300))
    return {
        ("theta",): [*_place(m)[1], _narrow(m)],
        ("w",): [spline(speed, 16) * np.sign(m.w)[:, None]],
        ("t",): [spline(_late(m), n) for n in (24, FINE)],
    }


def of_torque(m: Moving, u: np.ndarray) -> Surfaces:
    """Functions of the torque, alone and with the time or the place, (n, k) each."""
    torque = np.abs(u)
    largest = max(float(np.quantile(torque, 0.995)), 0.1 * float(torque.max()))
    of_u = spline(0.5 + 0.5 * np.clip(u / (largest + 1e-300), -1, 1), 12)
    of_u = of_u[:, np.mean(of_u > 0.05, axis=0) > RARE]
    return {
        ("u",): [_apart(of_u, u)],
        ("t", "u"): [_apart(u[:, None] * spline(_late(m), 10), u)],
        ("theta", "u"): [_apart(u[:, None] * _place(m)[2], u)],
    }


def of_law(m: Moving, z: np.ndarray) -> Surfaces:
    """Friction z that depends on the place or the time, and a torque of place and speed, (n, k)
    each."""
    _, places, coarse = _place(m)
    v, speed = 0.5 + 0.5 * np.clip(m.w / (_top(m) + 1e-300), -1, 1), m.w / (_top(m) + 1e-300)
    late = spline(_late(m), 10)
    return {
        ("theta", "w"): [*(z[:, None] * x for x in places), _products(spline(v, 6), coarse)],
        ("t", "w"): [_products(late, np.column_stack([z, speed]))],
    }


def spline(x: np.ndarray, n: int) -> np.ndarray:
    """n cubic B-splines over [0, 1] at x, (len(x), n)."""
    knots = np.concatenate([np.zeros(3), np.linspace(0, 1, n - 2), np.ones(3)])
    return BSpline.design_matrix(np.clip(x, 0, 1 - 1e-12), knots, 3).toarray()


def _waves(theta: np.ndarray, n: int) -> np.ndarray:
    return np.column_stack([f(k * theta) for k in range(1, n + 1) for f in (np.sin, np.cos)])


def _products(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    return (A[:, :, None] * B[:, None, :]).reshape(len(A), -1)


def _apart(X: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The columns without what a constant and u explain of them."""
    A = np.column_stack([np.ones(len(u)), u])
    return X - A @ np.linalg.lstsq(A, X, rcond=None)[0]
