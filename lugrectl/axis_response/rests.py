"""Rest as missing data: no law says what friction is while an axis stands.

There the torque is what the mechanics needs for the measured motion, and friction counts as part
of it: the samples then speak neither for nor against response and friction.
"""

from __future__ import annotations

import numpy as np

from .modes import Mechanics
from .runs import Run

SMOOTH = 0.12  # of the sampling rate: what the motion of a resting axis needs is slow


def filled(run: Run, U: np.ndarray, mechanics: Mechanics) -> np.ndarray:
    """The spectrum U of a command with the needed torque where the axis stands."""
    if not run.stands.any():
        return U
    w = run.w[1:]
    force = np.append(1.0, mechanics.advance(w))  # over it: torques in force, each at its own time
    needed = np.zeros(len(U), complex)
    slow = np.exp(-((w * run.dt / (2.0 * np.pi * SMOOTH)) ** 2))
    needed[1:] = run.W[1:] * slow / (mechanics.response(w) * force[1:])
    torque = np.where(run.stands, run.signal(needed), run.signal(U / force))
    return run.spectrum(torque) * force
