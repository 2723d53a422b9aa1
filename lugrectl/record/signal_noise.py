"""The step and the noise of a sampled signal, without a model of what made it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import coherence

_THIRD_DIFFERENCE = np.sqrt(20.0)  # std of white noise of unit variance, differenced three times
NORMAL_MAD = 0.6745  # median absolute value of a unit normal variable
SEGMENT = 256  # length of a segment of a spectrum, samples
DIFFERENCE = 4  # order of the difference that keeps slow motion out of it
TOP_OF_SPECTRUM = (0.3, 0.48)  # frequencies where only noise is left, times the rate
BAND = (0.125, 0.25)  # of the rate: above most motion, below where rounding hides a speed
TOGETHER = 0.8  # median coherence there from which two channels share their noise
NO_NOISE = 1e-12  # a standard deviation is never below this
OFF_LATTICE, ON_LATTICE = 0.02, 0.9  # steps off a lattice; share of the changes that are on it
LEFT_OUT = 0.001  # of the changes of a signal: so few may be anything


# ---- the step -----------------------------------------------------------------------


def smallest_step(x: np.ndarray) -> float:
    """Return the smallest change of a sampled signal (N,) between samples, due to its resolution;
    0 for one that always goes one way: its smallest change is a part of the motion."""
    x = x[np.isfinite(x)]
    steps = np.diff(x)
    moved = steps[np.abs(steps) > 1e-9 * max(float(np.ptp(x)), 1e-300)] if len(x) else steps
    up = np.count_nonzero(moved > 0)
    if max(up, len(moved) - up) >= (1.0 - LEFT_OUT) * len(steps):  # nowhere at rest
        return 0.0
    return float(np.quantile(np.abs(moved), LEFT_OUT)) if len(moved) else 0.0


def spread(x: np.ndarray) -> float:
    """Return the range of a channel without its rarest values, which may be none of it."""
    low, high = np.quantile(x, [0.01, 0.99])
    return float(high - low) or float(np.ptp(x))


def quantum(x: np.ndarray) -> float:
    """Return the step of the lattice that the values of a channel (N,) lie on; 0 if there is none.
    Unlike :func:`smallest_step` it needs no change from one sample to the next."""
    values = np.unique(x[:: max(1, len(x) // 20_000)])
    if len(values) < 3:
        return 0.0
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * spread(values)]
    if len(steps) < 2:
        return 0.0
    unit = float(np.median(steps[steps <= 1.5 * np.quantile(steps, 0.05)]))
    near = steps[steps < 20.5 * unit] / unit
    return unit if np.mean(np.abs(near - np.rint(near)) < 0.1) > 0.9 else 0.0


def lattice_step(x: np.ndarray) -> float:
    """Return the step of an encoder by the changes of its position (N,); 0 if it has none."""
    every = np.abs(np.diff(x))
    for step in (smallest_step(x), quantum(x)):  # a drive that never rests skips counts
        changes = every[every > 0.5 * step] / step if step > 0 else every[:0]
        on = np.abs(changes - np.round(changes)) < OFF_LATTICE
        if len(on) and np.mean(on) > ON_LATTICE:
            return step
    return 0.0


def resolution(x: np.ndarray) -> float:
    """Return the smallest change that the channel shows: its lattice, or what its digits make."""
    changes = np.abs(np.diff(x))
    changes = changes[changes > 1e-9 * spread(x)]
    return max(quantum(x), float(np.quantile(changes, 0.02))) if len(changes) else 0.0


def repeating(x: np.ndarray, resolution: float = 0.0) -> float:
    """Return after how many samples a signal usually changes its value; 1 if it always does.
    Samples between two encoder counts share one rounding error: they inform as one sample."""
    x = x[np.isfinite(x)]
    least = 0.5 * max(resolution, smallest_step(x))
    changed = np.flatnonzero(np.abs(np.diff(x)) > least)
    return float(np.median(np.diff(changed))) if len(changed) > 1 else 1.0


def repeats(x: np.ndarray, count: float = 0.0) -> np.ndarray:
    """Return for each sample (N,) how many in a row stay on its count, or keep its value."""
    steps = np.round((x - x[0]) / count) if count > 0.0 else x
    lengths = np.diff(np.flatnonzero(np.diff(steps, prepend=np.nan, append=np.nan) != 0.0))
    return np.repeat(lengths, lengths)


# ---- the noise ----------------------------------------------------------------------


def sensor_noise(x: np.ndarray, resolution: float = 0.0) -> float:
    """Return the standard deviation of a signal's own noise by its third differences (too high if
    the motion changes within four samples); never below the rounding of ``resolution``."""
    x = x[np.isfinite(x)]
    third = np.abs(np.diff(x, 3))
    noise = float(np.median(third)) / NORMAL_MAD / _THIRD_DIFFERENCE
    return max(noise, max(resolution, smallest_step(x)) / np.sqrt(12.0))


def share_noise(theta: np.ndarray, w: np.ndarray) -> bool:
    """Return whether theta and w are coherent above the frequencies of motion: one noise."""
    if len(theta) < 4 * SEGMENT:
        return False
    f, shared = coherence(np.diff(theta, 2), np.diff(w[1:]), nperseg=SEGMENT)
    return float(np.median(shared[(f > BAND[0]) & (f <= BAND[1])])) > TOGETHER


def white_noise(parts: Sequence[np.ndarray]) -> float:
    """Return the standard deviation of the white noise per sample, at least that of the quantum:
    the top of the spectrum of the fourth difference over its gain, |2 sin(pi f)|^8."""
    rounding = quantum(np.concatenate(parts)) / np.sqrt(12)
    d = np.concatenate([np.diff(x, DIFFERENCE) for x in parts])
    if len(d) < 64:
        return max(rounding, NO_NOISE)
    length = min(SEGMENT, len(d))
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    cut = sliding_window_view(d, length)[:: length - length // 2]  # as Welch, half overlapping
    lines = np.fft.rfft((cut - cut.mean(axis=1, keepdims=True)) * window)
    f = np.fft.rfftfreq(length)
    top = (f > TOP_OF_SPECTRUM[0]) & (f < TOP_OF_SPECTRUM[1])
    power = np.abs(lines[:, top] / np.linalg.norm(window)) ** 2
    level = np.median((power / (2 * np.sin(np.pi * f[top])) ** (2 * DIFFERENCE)).mean(axis=0))
    return float(max(np.sqrt(level), rounding, NO_NOISE))
