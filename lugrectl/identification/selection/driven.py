"""A unit inertia behind a spring, damper and gap, driven by the measured position."""

from __future__ import annotations

from functools import cache

import numpy as np

from ...spec import Block
from .motion import Motion

FINEST = 0.25  # rad of the load's own oscillation in one step


def torque_of_unit_load(
    m: Motion, block: Block, frequency: float, damping: float, gap: float
) -> np.ndarray:
    """Torque (n,) on the motor of a load of 1 kg m2 with that frequency (Hz), damping ratio and
    total gap (rad)."""
    omega = 2 * np.pi * frequency
    return _follow()(m.path, m.dt, omega, damping, 0.5 * gap)


@cache
def _follow():
    try:
        from numba import njit
    except ImportError:
        return _plain
    return njit(cache=True)(_plain)


def _plain(theta, dt, omega, zeta, gap):
    n = len(theta)
    out = np.zeros(n)
    sub = int(omega * dt / 0.25) + 1
    h = dt / sub
    k, c = omega * omega, 2 * zeta * omega
    x, v = theta[0], 0.0
    for i in range(n - 1):
        w = (theta[i + 1] - theta[i]) / dt
        s = 0.0
        for j in range(sub):
            g = theta[i] + w * h * (j + 0.5) - x
            a = 0.0
            if g > gap:
                a = k * (g - gap) + c * (w - v)
            elif g < -gap:
                a = k * (g + gap) + c * (w - v)
            v += h * a
            x += h * v
            s += a
        out[i] = s / sub
    out[n - 1] = out[n - 2]
    return out
