"""The noise of a sampled signal, without a model of what made it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import coherence

from .record import smallest_step
from .samples.outliers import quantum

_THIRD_DIFFERENCE = np.sqrt(20.0)  # std of white noise of unit variance, differenced three times
NORMAL_MAD = 0.6745  # median absolute value of a unit normal variable
SEGMENT = 256  # length of a segment of a spectrum, samples
DIFFERENCE = 4  # order of the difference that keeps slow motion out of it
TOP_OF_SPECTRUM = (0.3, 0.48)  # frequencies where only noise is left, times the rate
BAND = (0.125, 0.25)  # of the rate: above most motion, below where rounding hides a speed
TOGETHER = 0.8  # median coherence there from which two channels share their noise
NO_NOISE = 1e-12  # a standard deviation is never below this


def sensor_noise(x: np.ndarray, resolution: float = 0.0) -> float:
    """Standard deviation of a sampled signal's own noise, estimated without a model.

    Computed from the median size of the third differences, which are near zero for a finely
    sampled motion. Never below the rounding noise of the ``resolution`` (a step of q: q /
    sqrt(12)). The smallest step in the samples is used as well, but interpolated samples do not
    show it. The estimate is too high if the motion itself changes within four samples.
    """
    x = x[np.isfinite(x)]
    third = np.abs(np.diff(x, 3))
    spread = float(np.median(third)) / NORMAL_MAD / _THIRD_DIFFERENCE
    return max(spread, max(resolution, smallest_step(x)) / np.sqrt(12.0))


def repeating(x: np.ndarray, resolution: float = 0.0) -> float:
    """Usual number of samples after which a signal changes its value; 1 if it always does.

    Samples between two encoder counts share one rounding error and carry the information of one
    sample.
    """
    x = x[np.isfinite(x)]
    least = 0.5 * max(resolution, smallest_step(x))
    changed = np.flatnonzero(np.abs(np.diff(x)) > least)
    return float(np.median(np.diff(changed))) if len(changed) > 1 else 1.0


def repeats(x: np.ndarray, count: float) -> np.ndarray:
    """For each sample, how many in a row stay on the same count."""
    steps = np.round((x - x[0]) / count) if count > 0.0 else x
    lengths = np.diff(np.flatnonzero(np.diff(steps, prepend=np.nan, append=np.nan) != 0.0))
    return np.repeat(lengths, lengths)


def share_noise(theta: np.ndarray, w: np.ndarray) -> bool:
    """True if theta and w are coherent above the frequencies of motion: one noise is in both."""
    if len(theta) < 4 * SEGMENT:
        return False
    f, shared = coherence(np.diff(theta, 2), np.diff(w[1:]), nperseg=SEGMENT)
    return float(np.median(shared[(f > BAND[0]) & (f <= BAND[1])])) > TOGETHER


def white_noise(parts: Sequence[np.ndarray]) -> float:
    """Standard deviation of the white noise per sample, at least that of the quantum.

    The level of the top of the spectrum of the fourth difference, divided by the gain of that
    difference, |2 sin(pi f)|^8. The difference keeps slow motion from leaking there.
    """
    rounding = quantum(np.concatenate(parts)) / np.sqrt(12)
    d = np.concatenate([np.diff(x, DIFFERENCE) for x in parts])
    if len(d) < 64:
        return max(rounding, NO_NOISE)
    f, x = _top(d, min(SEGMENT, len(d)))
    power = np.abs(x) ** 2 / (2 * np.sin(np.pi * f)) ** (2 * DIFFERENCE)
    return float(max(np.sqrt(np.median(power.mean(axis=0))), rounding, NO_NOISE))


def _top(x: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies per sample of the top of the spectrum, and Welch's transforms there.

    Hann windows of ``length`` samples, half overlapping, without their means, of unit power.
    """
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    parts = sliding_window_view(x, length)[:: length - length // 2]
    made = np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window)
    f = np.fft.rfftfreq(length)
    top = (f > TOP_OF_SPECTRUM[0]) & (f < TOP_OF_SPECTRUM[1])
    return f[top], made[:, top] / np.linalg.norm(window)
