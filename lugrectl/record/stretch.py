"""A stretch of a log with equal time steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Stretch:
    """M samples of one log at equal time steps, none of them filtered.

    Attributes
    ----------
    run : int
        Index of the log that it comes from.
    dt : float
        Time step in s.
    t, u : ndarray (M,)
        Time in s and torque in N m.
    theta, w : ndarray (M,) or None
        Position in rad and speed in rad/s, where the log has them.
    ok : ndarray (M,) of bool
        False where a sample is missing or bad.
    """

    run: int
    dt: float
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray | None
    ok: np.ndarray
