"""A free swing as a trajectory, fitted as a whole to what was measured of it.

    x'' = -S sin x - C cos x - Fv/J x' - (Fc/J + (Fs - Fc)/J exp(-(x'/vs)^2)) sign(x')

in central differences, whose unknowns are solved for at once: the equations are a band, and so
are those of the sensitivities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from ..blocks.friction import level
from .momentum import Fitted, memory

KNOTS = 150  # of a period
ROUNDS = 8  # of Gauss and Newton
SETTLED = 1e-2  # standard errors of a step that ends them
FAR = 10.0  # rad, by which no trajectory moves in a step
LONGEST = 0.7  # step of log(vs)
SHARP = 1e-3  # of the top speed, over which the sign turns


@dataclass(frozen=True, eq=False)
class Swing:
    """Means ``y`` over cells of ``h`` s: of the angle, of the speed where ``speed`` is True; ``x``
    is an angle to begin with."""

    h: float
    x: np.ndarray
    y: np.ndarray
    speed: bool

    def forces(self, p: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The acceleration at the inner knots, and its slopes by x and by the speed; the columns
        that the values multiply."""
        v = (x[2:] - x[:-2]) / (2 * self.h)
        x = x[1:-1]
        e = SHARP * float(np.abs(v).max())
        root = np.sqrt(v**2 + e**2)
        s, ds = v / root, e**2 / root**3
        columns = [np.sin(x), np.cos(x), s, v]
        slope = p[2] * ds + p[3]
        if len(p) > 4:
            fall, vs = p[4], np.exp(p[5])
            g = level(v, 0.0, 1.0, vs)
            columns += [s * g, fall * s * g * 2 * (v / vs) ** 2]
            slope = slope + fall * g * (ds - 2 * s * v / vs**2)
        return np.array(columns), p[0] * np.cos(x) - p[1] * np.sin(x), slope

    def linear(self, p: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The band of the equations, what they leave, and the columns of the values."""
        columns, by_x, by_v = self.forces(p, x)
        h, n = self.h, len(x)
        left = np.diff(x, 2) / h**2 + p[:5] @ columns[:5]
        band = np.zeros((3, n))
        band[0] = 1.0
        band[0, 2:] = 1 / h**2 + by_v / (2 * h)
        band[1, 1:-1] = -2 / h**2 + by_x
        band[2, :-2] = 1 / h**2 - by_v / (2 * h)
        return band, left, columns

    def trajectory(self, p: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The solution that begins with the first two knots of x."""
        for _ in range(ROUNDS):
            band, left, _ = self.linear(p, x)
            step = solve_banded((2, 0), band, np.r_[0.0, 0.0, left])
            x = x - step
            if not np.abs(step).max() < FAR:
                raise np.linalg.LinAlgError("the swing turns over")
            if np.abs(step).max() < 1e-7 * np.ptp(x):
                break
        return x

    def slopes(self, p: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The derivatives of the trajectory by the values and its first two knots."""
        band, _, columns = self.linear(p, x)
        rhs = np.zeros((len(x), len(p) + 2))
        rhs[2:, : len(p)] = -columns.T
        rhs[0, len(p)] = 1.0
        rhs[:2, len(p) + 1] = 0.0, 1.0
        return solve_banded((2, 0), band, rhs)

    def seen(self, x: np.ndarray) -> np.ndarray:
        """What is measured of a trajectory, at its inner knots."""
        return (x[2:] - x[:-2]) / (2 * self.h) if self.speed else x[1:-1]


def fitted(swings: Sequence[Swing], p: np.ndarray, names: tuple[str, ...]) -> Fitted | None:
    """The values that all swings share (S, C, Fc/J, Fv/J, and of falling friction (Fs - Fc)/J and
    log(vs)), by least squares from a start; None where it leads nowhere."""
    try:
        return _fitted(swings, p, names)
    except np.linalg.LinAlgError:
        return None


def _fitted(swings: Sequence[Swing], p: np.ndarray, names: tuple[str, ...]) -> Fitted | None:
    m, xs = len(p), [s.x for s in swings]
    made = None
    for _ in range(ROUNDS):
        xs = [s.trajectory(p, x) for s, x in zip(swings, xs, strict=True)]
        A, r = _linear(swings, p, xs)
        free = len(r) - A.shape[1]
        if free < 3 or not (np.all(np.isfinite(A)) and np.all(np.isfinite(r))):
            return None
        size = np.linalg.norm(A, axis=0)
        inverse = np.linalg.pinv((A / size).T @ (A / size))
        step = inverse @ ((A / size).T @ r) / size
        cost, together = float(r @ r), memory(r)
        V = inverse / np.outer(size, size) * cost / free * together
        p = p + np.r_[step[: min(m, 5)], np.clip(step[5:m], -LONGEST, LONGEST)]
        for x, own in zip(xs, step[m:].reshape(-1, 2), strict=True):
            x[:2] += own
        moved = float(np.std(np.concatenate([s.y for s in swings])))
        left, rows = float(np.sqrt(cost / free)), free / together
        made = Fitted(names, p, V[:m, :m], rows, left, cost, moved, rows)
        if np.all(np.abs(step) < SETTLED * np.sqrt(np.diag(V))):
            break
    return made


def _linear(
    swings: Sequence[Swing], p: np.ndarray, xs: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The slopes of all that is measured, by the values and two knots of each swing, and what is
    left of it."""
    m, made = len(p), []
    for i, (s, x) in enumerate(zip(swings, xs, strict=True)):
        own = s.seen(s.slopes(p, x))
        A = np.zeros((len(own), m + 2 * len(swings)))
        A[:, :m], A[:, m + 2 * i : m + 2 * i + 2] = own[:, :m], own[:, m:]
        made.append((A, s.y - s.seen(x)))
    return np.concatenate([A for A, _ in made]), np.concatenate([r for _, r in made])
