"""The motion and torque of a run, smoothed alike, as every model of the held-out part sees it.

Even time grid, zero-phase Butterworth filter of order 4 on u and on the motion, central
differences; samples near standstill and at the ends do not count.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

ENDS = 1.0  # periods of the corner frequency that are left out at either end


@dataclass(frozen=True)
class Filter:
    """Step of the grid, s; corner frequency, Hz; least speed that counts, rad/s or m/s."""

    dt: float
    corner: float
    bound: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Smoothed signals (N,); ``use`` marks the samples that count. theta is None without one."""

    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray
    a: np.ndarray
    use: np.ndarray

    def late(self, shift: float) -> np.ndarray:
        """The torque that acts ``shift`` later than it is logged, u(t - shift)."""
        return np.interp(self.t - shift, self.t, self.u)

    def angle(self) -> np.ndarray:
        """theta, or zeros where it was not recorded."""
        return np.zeros_like(self.t) if self.theta is None else self.theta


@dataclass(frozen=True, eq=False)
class Run:
    """A run as the package reads it (``log``) and its smoothed motion."""

    log: Any
    motion: Motion

    @property
    def hold(self) -> float:
        """Half a step of the log, s: a torque that is held acts so much later than its stamp."""
        return 0.5 * float(np.nanmedian(np.diff(self.log.t)))


def motion_of(log: Mapping[str, np.ndarray], by: Filter) -> Motion:
    """The motion of a log with t, u and theta or w. Of both theta is taken: w is often late."""
    t = np.arange(log["t"][0], log["t"][-1], by.dt)
    sos = butter(4, by.corner, fs=1 / by.dt, output="sos")

    def smooth(name: str) -> np.ndarray:
        return sosfiltfilt(sos, np.interp(t, log["t"], log[name]))

    theta = smooth("theta") if "theta" in log else None
    w = smooth("w") if theta is None else np.gradient(theta, by.dt)
    ends = round(ENDS / by.corner / by.dt)
    use = np.abs(w) > by.bound
    use[:ends] = use[len(use) - ends :] = False
    return Motion(t, smooth("u"), theta, w, np.gradient(w, by.dt), use)


def rms(x: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))
