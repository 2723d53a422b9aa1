"""Cycles that never stick: at each w = 0 the torque is above Fs.

Their state there has two numbers, the error and the excess of the torque. Newton on the half turn
starts where motions that never stick come closest to repeating, and so do motions from the border
between rest and growth, which follow an unstable cycle for a while.
"""

from __future__ import annotations

import numpy as np

from .lanes import Lanes
from .slip import slip
from .stick_map import NEVER

SWINGS = 100  # that are followed, at most
STARTS = 4  # of the errors from which no stick followed
STEPS = 15  # of Newton
NUDGE = 1e-5  # relative, by which a slope is measured
ALIKE = 1e-6  # relative change from swing to swing, below which it repeats
SAME = 1e-3  # relative difference of two amplitudes that are one


def swinging(
    lanes: Lanes, x: np.ndarray, D: np.ndarray, borders: list[float]
) -> list[tuple[float, float, tuple[float, ...]]]:
    """Amplitude, period and multipliers of a turn of each, in units."""
    never = x[D >= NEVER]
    if not len(never):
        return []
    some = never[np.unique(np.linspace(0, len(never) - 1, STARTS).astype(int))]
    found = [_newton(lanes, seed) for seed in _seeds(lanes, np.r_[some, borders])]
    made: list[tuple[float, float, tuple[float, ...]]] = []
    for one in sorted(f for f in found if f):
        if not made or abs(one[0] / made[-1][0] - 1.0) > SAME:
            made.append(one)
    return made


def _half(lanes: Lanes, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The next state at w = 0 of each (2, n), signs changed, and the time; nan where it sticks."""
    end = slip(lanes[np.zeros(state.shape[1], int)], *state)
    new = np.array([-end.x, -2.0 - end.y])
    lost = end.rests | (new[0] <= 0.0) | (new[1] <= 0.0) | (new[0] > lanes.large)
    return np.where(lost, np.nan, new), end.t


def _seeds(lanes: Lanes, at: np.ndarray) -> list[np.ndarray]:
    """From each error the state at which a swing changed least."""
    state, least = np.array([at, 0.0 * at]), np.full(len(at), np.inf)
    best = np.full_like(state, np.nan)
    for _ in range(SWINGS):
        new, _ = _half(lanes, state)
        change = np.abs(new - state).sum(axis=0) / state[0]
        better = change < least
        least, best = np.where(better, change, least), np.where(better, new, best)
        goes = np.isfinite(new[0]) & (change > ALIKE)
        if not goes.any():
            break
        state = np.where(goes, new, state)
    return [seed for seed in best.T if np.isfinite(seed).all()]


def _newton(lanes: Lanes, state: np.ndarray) -> tuple[float, float, tuple[float, ...]] | None:
    for _ in range(STEPS):
        step = NUDGE * state[0]
        three, t = _half(lanes, state[:, None] + step * np.array([[0, 1, 0], [0, 0, 1]]))
        if not np.isfinite(three).all():
            return None
        now = three[:, 0]
        A = (three[:, 1:] - now[:, None]) / step
        if np.abs(now - state).max() < ALIKE * state[0]:
            turn = sorted(np.linalg.eigvals(A) ** 2, key=abs, reverse=True)
            return float(state[0]), float(2.0 * t[0]), tuple(float(abs(m)) for m in turn)
        state = state + np.linalg.solve(A - np.eye(2), state - now)
        if not np.all(state > 0.0):
            return None
    return None
