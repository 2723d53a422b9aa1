"""An unknown torque as a row of the table: a smooth function of some signals.

Splines or waves with a Gaussian prior on their coefficients; its width is one of two, the more
likely one. It competes like any effect.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import BSpline

from .base import Base, Columns, rms
from .contender import Entry

AMPLITUDES = (0.04, 0.2)  # width of the prior, in friction
TURNS = 6.5  # rad of travel from which the place is an angle
RARE = 0.02  # a column that is 0 on all but this share of the rows is u itself on the others


def entries(base: Base) -> Iterator[Entry]:
    """An entry for each set of signals and width of the prior."""
    size = base.friction_rms
    for signals, bases in _bases(base).items():
        for samples in bases:
            C = base.record.mean(samples)
            own = np.sqrt(np.mean(C**2, axis=0))
            own = np.maximum(own, 1e-3 * rms(own) + 1e-300)
            for amplitude in AMPLITUDES if not base.view.quick else (0.1,):
                prior = (own / (amplitude * size)) ** 2
                free = np.full(C.shape[1], np.inf)
                cost = float(np.log(3 * len(bases)))
                yield Entry(
                    "unknown(" + ", ".join(signals) + ")",
                    {"amplitude": amplitude},
                    Columns(C, prior, -free, free),
                    cost=cost,
                    depends_on=frozenset(signals),
                )


def _bases(base: Base) -> dict[tuple[str, ...], list[np.ndarray]]:
    """Columns (n, k) for each set of signals; more than one way for a position that turns."""
    m, u, z = base.record.motion, base.u, base.law.z
    span, late = float(np.ptp(m.theta)) + 1e-12, m.t / m.t[-1]
    x, v = (m.theta - m.theta.min()) / span, 0.5 + 0.5 * np.clip(m.w / (m.top + 1e-300), -1, 1)
    speed = m.w / (m.top + 1e-300)
    turns = span > TURNS and m.motion != "linear"
    places = [_waves(m.theta, 12), spline(x, 16)] if turns else [spline(x, 16)]
    coarse = _waves(m.theta, 6) if turns else spline(x, 8)
    torque = np.abs(u)
    largest = max(float(np.quantile(torque, 0.995)), 0.1 * float(torque.max()))
    of_u = spline(0.5 + 0.5 * np.clip(u / largest, -1, 1), 12)
    of_u = of_u[:, np.mean(of_u > 0.05, axis=0) > RARE]
    return {
        ("theta",): places,
        ("w",): [spline(np.abs(speed), 16) * np.sign(m.w)[:, None]],
        ("t",): [spline(late, 24)],
        ("u",): [_apart(of_u, u)],
        ("theta", "w"): [
            *(z[:, None] * p for p in places),
            _products(spline(v, 6), coarse),
        ],
        ("t", "w"): [_products(spline(late, 10), np.column_stack([z, speed]))],
        ("t", "u"): [_apart(u[:, None] * spline(late, 10), u)],
        ("theta", "u"): [_apart(u[:, None] * coarse, u)],
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
