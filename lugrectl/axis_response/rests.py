"""Rest as missing data: no law says what friction is while an axis stands.

There friction is the command less what the mechanics needs for the measured motion: the samples
then speak neither for nor against the response.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .modes import Mechanics
from .runs import Run

FEW = 0.01  # of the samples: so little rest changes nothing
SMOOTH = 0.12  # of the sampling rate: what the motion of a resting axis needs is slow


def at_rest(
    runs: Sequence[Run],
    torques: Sequence[np.ndarray],
    friction: Sequence[np.ndarray],
    mechanics: Mechanics | None,
) -> tuple[np.ndarray, ...]:
    """The spectra of friction with what the torque leaves where the axis stands."""
    if mechanics is None:
        return tuple(friction)
    made = zip(runs, torques, friction, strict=True)
    return tuple(_filled(run, U, F, mechanics) for run, U, F in made)


def _filled(run: Run, U: np.ndarray, F: np.ndarray, mechanics: Mechanics) -> np.ndarray:
    if not run.count or run.stands.mean() < FEW:
        return F
    w = run.w[1:]
    needed = np.zeros(len(U), complex)
    slow = np.exp(-((w * run.dt / (2.0 * np.pi * SMOOTH)) ** 2))
    a = mechanics.advance(w)
    needed[1:] = a * run.W[1:] * slow / (mechanics.response(w) * a)
    # both as torques in force, so that the rest is at its own time
    force = np.append(1.0, a)
    inside = run.signal(U / force) - run.signal(needed / force)
    return run.spectrum(np.where(run.stands, inside, run.signal(F / force))) * force
