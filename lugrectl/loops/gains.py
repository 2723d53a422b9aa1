"""Gains of a controller from the poles of its loop around J alone."""

from __future__ import annotations

import numpy as np


def placed(J: float, *poles: float) -> dict[str, float]:
    """Return the gains with which J s^2 + kp s + ki, or J s^3 + kd s^2 + kp s + ki, is zero at
    minus two or three rates in 1/s."""
    names = ("kp", "ki") if len(poles) == 2 else ("kd", "kp", "ki")
    gains = dict(zip(names, J * np.poly(-np.array(poles))[1:], strict=True))
    return {k: float(gains[k]) for k in ("kp", "ki", "kd") if k in gains}


def all_at(kind: str, J: float, rate: float) -> dict[str, float]:
    """Return the gains with every pole at -rate."""
    return placed(J, *[rate] * (2 if kind == "velocity" else 3))


def crossing(kind: str, J: float, bandwidth: float) -> dict[str, float]:
    """Return the gains of a PI that crosses over at the bandwidth in rad/s, its integral 20 times
    as slow, or of a critically damped PD with kd/J there."""
    if kind == "velocity":
        split = np.sqrt(1.0 - 4.0 / 20.0)  # of two poles with the sum b and the product b^2/20
        return placed(J, 0.5 * (1.0 + split) * bandwidth, 0.5 * (1.0 - split) * bandwidth)
    return placed(J, 0.5 * bandwidth, 0.5 * bandwidth, 0.0)
