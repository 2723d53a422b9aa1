"""The noise of each channel, from the log alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .constants import DIFFERENCE, MANY, MOST, NO_NOISE, SEGMENT, TOP_OF_SPECTRUM


def quantum(x: np.ndarray) -> float:
    """The step of the lattice on which the values lie; 0 if they lie on none."""
    x = x[:: max(1, len(x) // MANY)]
    values = np.unique(x)
    steps = np.diff(values)
    steps = steps[steps > 1e-11 * np.sum(steps)]
    if len(steps) < 20 or len(values) > MOST * len(x):
        return 0.0
    step = np.median(steps[steps < 1.5 * np.quantile(steps, 0.05)])
    near = steps[steps < 20.5 * step] / step
    on_lattice = np.mean(np.abs(near - np.round(near)) < 0.1) > 0.9
    return float(step) if on_lattice else 0.0


def white_noise(parts: Sequence[np.ndarray], stepped: bool = False) -> float:
    """Standard deviation of the white noise per sample, at least that of the quantum.

    The level of the top of the spectrum of the fourth difference, divided by the gain of that
    difference, |2 sin(pi f)|^8. The difference keeps slow motion from leaking there. Where the
    signal is ``stepped``, as a command is, it is the median over the segments, by that of an
    exponential density, ln 2: steps fill the spectrum of few segments.
    """
    rounding = quantum(np.concatenate(parts)) / np.sqrt(12)
    d = np.concatenate([np.diff(x, DIFFERENCE) for x in parts])
    if len(d) < 64:
        return max(rounding, NO_NOISE)
    f, x = _top(d, min(SEGMENT, len(d)))
    power = np.abs(x) ** 2 / (2 * np.sin(np.pi * f)) ** (2 * DIFFERENCE)
    level = np.median(power) / np.log(2) if stepped else np.median(power.mean(axis=0))
    return float(max(np.sqrt(level), rounding, NO_NOISE))


def shared_noise(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Coherence of two channels at the top of the spectrum, 0 to 1."""
    one, other = (np.concatenate([np.diff(p[i], DIFFERENCE) for p in pairs]) for i in (0, 1))
    if len(one) < 4 * SEGMENT or not (one.any() and other.any()):
        return 0.0
    x, y = _top(one, SEGMENT)[1], _top(other, SEGMENT)[1]
    with np.errstate(divide="ignore", invalid="ignore"):  # no power at all at a frequency
        c = np.abs(np.mean(np.conj(x) * y, axis=0)) ** 2
        c = c / np.mean(np.abs(x) ** 2, axis=0) / np.mean(np.abs(y) ** 2, axis=0)
    return float(np.nan_to_num(np.median(c)))


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
