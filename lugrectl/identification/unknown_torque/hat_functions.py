"""Hat functions (linear splines) of a signal, along a line or around a turn."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from ...blocks.table import TURN

TURNING = 1.25  # turns of travel, from which functions of the angle within a turn are used


def wraps(theta: np.ndarray, motion: str) -> bool:
    """True if the drive turns far enough for functions of the angle within a turn."""
    return motion == "rotary" and bool(np.ptp(theta) > TURNING * TURN)


def turn(count: int) -> np.ndarray:
    """Points around one turn, rad."""
    return np.linspace(-np.pi, np.pi, count, endpoint=False)


def hats(x: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Hat functions (linear splines) of these points at x, (len(x), points)."""
    knots = np.r_[points[0], points, points[-1]]
    return BSpline.design_matrix(x, knots, 1).toarray()


def around(x: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The same, periodic over one turn."""
    closed = np.r_[points, points[0] + TURN]
    A = hats(np.clip(np.mod(x - points[0], TURN) + points[0], closed[0], closed[-1]), closed)
    A[:, 0] += A[:, -1]
    return A[:, :-1]
