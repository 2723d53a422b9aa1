"""What a drive is asked to do: references of speed, or torques without a controller."""

from __future__ import annotations

import numpy as np

REFERENCES = ("mixed", "chirp", "sine", "steps", "staircase", "trapezoid")


def speed(kind: str, t: np.ndarray, top: float, pace: float, rng) -> np.ndarray:
    """A reference of w (rad/s) at the times t (s) that reaches about ``top``; ``pace`` in Hz.

    Every other reference with jumps is slewed, as most drives do.
    """
    w = globals()[f"_{kind}"](t, top, pace, rng)
    if kind in ("mixed", "steps", "staircase") and rng.random() < 0.5:
        w = _slewed(w, rng.uniform(0.03, 0.15) / pace, t)
    return w


def slower_at_times(t: np.ndarray, pace: float) -> np.ndarray:
    """Factors between 1 and 0.03 that wander over all decades between, for what is slow."""
    return 10.0 ** (-1.5 * abs((t * pace / 6.0) % 2.0 - 1.0))


def torque(t: np.ndarray, size: float, pace: float, rng) -> np.ndarray:
    """Torques (N m) held for a while, up to ``size``, equally long to both sides, and a sine."""
    n = int(t[-1] * pace) + 2
    levels = rng.uniform(0.3, 1.0, n) * np.where(np.arange(n) % 2, 1.0, -1.0)
    levels[rng.random(n) < 0.15] = 0.0
    held = _held(t, levels, rng.uniform(0.6, 1.4, n) / pace)
    return size * (0.8 * held + 0.2 * np.sin(2 * np.pi * 2.3 * pace * t + rng.uniform(0, 6)))


def _held(t, levels, lengths):
    ends = np.cumsum(lengths)
    ends *= max(1.0, (t[-1] + 1e-9) / ends[-1])
    return levels[np.searchsorted(ends, t).clip(0, len(levels) - 1)]


def _mixed(t, top, pace, rng):
    frequencies = pace * np.array([0.21, 0.83, 1.9]) * rng.uniform(0.8, 1.25, 3)
    phases = rng.uniform(0, 2 * np.pi, 3)
    sizes = np.array([0.4, 0.3, 0.1])
    waves = sizes @ np.sin(2 * np.pi * np.outer(frequencies, t) + phases[:, None])
    return top * (waves + 0.4 * _steps(t, 1.0, 0.4 * pace, rng))


def _chirp(t, top, pace, rng):
    low, high = pace * rng.uniform(0.1, 0.3), pace * rng.uniform(1.5, 2.5)
    rate = np.log(high / low) / t[-1]
    return top * np.sin(2 * np.pi * low * np.expm1(rate * t) / rate)


def _sine(t, top, pace, rng):
    size = 0.65 + 0.35 * np.sin(2 * np.pi * pace * rng.uniform(0.05, 0.15) * t)
    return top * size * np.sin(2 * np.pi * pace * rng.uniform(0.7, 1.4) * t)


def _steps(t, top, pace, rng):
    n = int(1.5 * t[-1] * pace) + 3
    return _held(t, top * rng.uniform(-1, 1, n), rng.uniform(0.5, 1.5, n) / pace)


def _staircase(t, top, pace, rng):
    up = np.linspace(-1, 1, 2 * int(rng.integers(3, 7)))
    levels = np.r_[up, up[::-1]]
    n = max(int(t[-1] * pace), len(levels)) + 1
    return top * _held(t, np.resize(levels, n), np.full(n, t[-1] / n))


def _trapezoid(t, top, pace, rng):
    n = int(1.5 * t[-1] * pace) + 3
    sizes = rng.uniform(0.4, 1, n) * np.where(np.arange(n) % 2, 1, -1)
    lengths = rng.uniform(0.6, 1.4, n) / pace
    return _slewed(_held(t, top * sizes, lengths), rng.uniform(0.1, 0.3) / pace, t)


def _slewed(w, seconds, t):
    """Jumps become ramps of so many seconds."""
    n = max(int(seconds / (t[1] - t[0])), 1)
    total = np.cumsum(np.r_[np.zeros(n), w])
    return (total[n:] - total[:-n]) / n
