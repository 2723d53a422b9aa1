"""Resampling of channels from their recorded time stamps to an even grid."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

HELD = ("u", "d", "r")  # channels held between samples; the others are interpolated
MOTION = ("theta", "w", "theta_load")  # smooth: linear interpolation errs by more than their noise
_APART = 0.5  # of the step; between closer stamps a spline would read noise as a slope


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


def held_mean(stamps: np.ndarray, values: np.ndarray, grid: np.ndarray, dt: float) -> np.ndarray:
    """Mean of the held signal over each step; this keeps its time integral."""
    ends = np.r_[stamps, max(stamps[-1], grid[-1]) + 2 * dt]
    integral = np.r_[0.0, np.cumsum(values * np.diff(ends))]
    return (np.interp(grid + dt, ends, integral) - np.interp(grid, ends, integral)) / dt
