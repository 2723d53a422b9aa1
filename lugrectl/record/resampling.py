"""Channels brought from the stamps they were recorded at to an even grid."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

HELD = ("u", "d", "r")  # channels held between samples; the others are interpolated
MOTION = ("theta", "w", "theta_load")  # smooth; straight lines miss them by more than their noise
_APART = 0.5  # of the step; of two stamps that are closer a spline would take noise for a slope
_CALMER = 0.5  # of the roughness that grows with speed, below which a speed was a position
_BESIDE = 4  # samples on either side of a loss by which it is judged


def between(role: str, at: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Interpolate; before the first and after the last point their values are kept."""
    if role not in MOTION or len(at) < 2:
        return np.interp(grid, at, values)
    steps = np.diff(at)
    apart = np.r_[True, steps > _APART * np.median(steps)]
    return np.asarray(CubicSpline(at[apart], values[apart])(np.clip(grid, at[0], at[-1])))


def speed(
    at: np.ndarray, counts: np.ndarray, w: np.ndarray, grid: np.ndarray, resampled: bool
) -> np.ndarray:
    """A speed on the grid, recorded at times ``at`` in steps, of whole steps ``counts``.

    One that is a position's difference, as if each step were the same, is uneven for the
    stamps' sake alone, and too large after a sample that was lost before it was taken: it is
    brought there as that position.
    """
    steps = np.diff(counts, prepend=counts[0] - 1)
    if _over_losses(w, steps):
        return _as_position(at, w, grid)
    plain = between("w", at, w, grid)
    if not resampled:
        return plain
    moved = _as_position(at, w * steps, grid)
    return moved if _roughened(moved, plain) < _CALMER * _roughened(plain, plain) else plain


def _over_losses(w: np.ndarray, steps: np.ndarray) -> bool:
    """Whether a speed is as much too large after a loss as the step is too long."""
    lost = np.flatnonzero(steps > 1)
    around = lost[:, None] + np.r_[-_BESIDE:0, 1 : _BESIDE + 1]
    usual = w[np.clip(around, 0, len(w) - 1)].mean(1)
    more = usual * (steps[lost] - 1)
    return bool((w[lost] - usual) @ more > 0.5 * (more @ more))


def _as_position(at: np.ndarray, travels: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """The differences on the grid of a position that travelled so far at each step."""
    theta = np.cumsum(travels)
    return np.diff(between("theta", at, theta, grid), prepend=theta[0] - travels[0])


def _roughened(x: np.ndarray, w: np.ndarray) -> float:
    """How much rougher x is where the speed is high: what stamps do, and no sensor's noise."""
    fast = w[:-3] ** 2
    return float(np.mean(np.diff(x, 3) ** 2 * (fast - fast.mean())))


def held_mean(stamps: np.ndarray, values: np.ndarray, grid: np.ndarray, dt: float) -> np.ndarray:
    """Mean of the held signal over each step, so that its time integral is kept."""
    ends = np.r_[stamps, max(stamps[-1], grid[-1]) + 2 * dt]
    integral = np.r_[0.0, np.cumsum(values * np.diff(ends))]
    return (np.interp(grid + dt, ends, integral) - np.interp(grid, ends, integral)) / dt
