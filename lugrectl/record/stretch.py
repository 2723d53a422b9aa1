"""A stretch of a log: its rows on uniform time, ready for the torque balance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Stretch:
    """Uniform time, nothing filtered: at most the stamps are interpolated.

    ``run`` is the index of the log that it comes from, ``dt`` the step in s. ``t`` (s), ``u``
    (N m or N), ``theta`` (rad or m) and ``w`` (rad/s or m/s) are (M,), theta and w None where
    not recorded, ``d`` (M,) the measured load torque. ``ok`` (M,) is False where a sample is
    missing, bad or bridged over more than a sample. ``jitter`` is the RMS distance of the stamps
    from even ones, in steps.
    """

    run: int
    dt: float
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray | None
    ok: np.ndarray
    jitter: float = 0.0
    d: np.ndarray | None = None
