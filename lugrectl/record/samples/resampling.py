"""Resampling of channels from their recorded time stamps to an even grid."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

HELD = ("u", "d", "r")  # channels held between samples; the others are interpolated
MOTION = ("theta", "w", "theta_load")  # smooth: linear interpolation errs by more than their noise
_APART = 0.5  # of the step; between closer stamps a spline would read noise as a slope
_CALMER = 0.5  # of the roughness that grows with speed; below, w was the difference of a position
_BESIDE = 4  # samples on either side of a loss with which it is compared


def how(role: str) -> str:
    """How the missing samples of a channel are filled in."""
    return "held" if role in HELD else "interpolated"


def between(role: str, at: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Interpolate; before the first and after the last point the value is constant."""
    if role not in MOTION or len(at) < 2:
        return np.interp(grid, at, values)
    steps = np.diff(at)
    apart = np.r_[True, steps > _APART * np.median(steps)]
    return np.asarray(CubicSpline(at[apart], values[apart])(np.clip(grid, at[0], at[-1])))


def on_grid(
    role: str, at: np.ndarray, values: np.ndarray, grid: np.ndarray, dt: float
) -> np.ndarray:
    """Return a channel on a grid of step dt: a held one with its time integral."""
    if role in HELD:
        return held_mean(at, values, grid, dt)
    return between(role, at, values, grid)


def speed(
    at: np.ndarray, counts: np.ndarray, w: np.ndarray, grid: np.ndarray, resampled: bool
) -> np.ndarray:
    """Resample a speed, recorded at the times ``at`` (in steps, rounded: ``counts``). One that was
    a position difference with a constant step is summed, resampled and differenced again."""

    def as_position(travels: np.ndarray) -> np.ndarray:
        theta = np.cumsum(travels)
        return np.diff(between("theta", at, theta, grid), prepend=theta[0] - travels[0])

    steps = np.diff(counts, prepend=counts[0] - 1)
    lost = np.flatnonzero(steps > 1)
    around = lost[:, None] + np.r_[-_BESIDE:0, 1 : _BESIDE + 1]
    usual = w[np.clip(around, 0, len(w) - 1)].mean(1)
    more = usual * (steps[lost] - 1)
    if (w[lost] - usual) @ more > 0.5 * (more @ more):  # too large after each loss
        return as_position(w)
    plain = between("w", at, w, grid)
    if not resampled:
        return plain
    moved = as_position(w * steps)
    return moved if _roughened(moved, plain) < _CALMER * _roughened(plain, plain) else plain


def _roughened(x: np.ndarray, w: np.ndarray) -> float:
    """How much rougher x is at high speed: stamp jitter causes this, sensor noise does not."""
    fast = w[:-3] ** 2
    return float(np.mean(np.diff(x, 3) ** 2 * (fast - fast.mean())))


def held_mean(stamps: np.ndarray, values: np.ndarray, grid: np.ndarray, dt: float) -> np.ndarray:
    """Mean of the held signal over each step; this keeps its time integral."""
    ends = np.r_[stamps, max(stamps[-1], grid[-1]) + 2 * dt]
    integral = np.r_[0.0, np.cumsum(values * np.diff(ends))]
    return (np.interp(grid + dt, ends, integral) - np.interp(grid, ends, integral)) / dt
