"""The noise of each channel, from the log alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .constants import (
    DIFFERENCE,
    LATTICE,
    MANY_VALUES,
    NO_NOISE,
    SEGMENT,
    TOP_OF_SPECTRUM,
)


def quantum(x: np.ndarray) -> float:
    """The step of the lattice on which the values lie; 0 if they lie on none."""
    x = x[:: max(1, len(x) // MANY_VALUES)]
    values = np.unique(x)
    steps = np.diff(values)
    steps = steps[steps > 1e-11 * np.sum(steps)]
    if len(steps) < 20 or len(values) > LATTICE * len(x):
        return 0.0
    step = np.median(steps[steps < 1.5 * np.quantile(steps, 0.05)])
    near = steps[steps < 20.5 * step] / step
    on_lattice = np.mean(np.abs(near - np.round(near)) < 0.1) > 0.9
    return float(step) if on_lattice else 0.0


def white_noise(parts: Sequence[np.ndarray]) -> float:
    """Standard deviation of the white noise per sample, at least that of the quantum.

    The level of the top of the spectrum of the fourth difference, divided by the gain of that
    difference, |2 sin(pi f)|^8. The difference keeps slow motion from leaking there.
    """
    rounding = quantum(np.concatenate(parts)) / np.sqrt(12)
    d = np.concatenate([np.diff(x, DIFFERENCE) for x in parts])
    if len(d) < 64:
        return max(rounding, NO_NOISE)
    f, (power,) = _spectra(min(SEGMENT, len(d)), [(d, d)])
    power = np.real(power)
    top = (f > TOP_OF_SPECTRUM[0]) & (f < TOP_OF_SPECTRUM[1])
    level = np.median(power[top] / (2 * np.sin(np.pi * f[top])) ** (2 * DIFFERENCE)) / 2
    return float(max(np.sqrt(level), rounding, NO_NOISE))


def shared_noise(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Coherence of two channels at the top of the spectrum, 0 to 1."""
    one, other = (np.concatenate([np.diff(p[i], DIFFERENCE) for p in pairs]) for i in (0, 1))
    if len(one) < 4 * SEGMENT or not (one.any() and other.any()):
        return 0.0
    with np.errstate(divide="ignore", invalid="ignore"):  # no power at all at a frequency
        f, (both, own, its) = _spectra(SEGMENT, [(one, other), (one, one), (other, other)])
        c = np.abs(both) ** 2 / np.real(own) / np.real(its)
    top = (f > TOP_OF_SPECTRUM[0]) & (f < TOP_OF_SPECTRUM[1])
    return float(np.nan_to_num(np.median(c[top])))


def _spectra(
    length: int, pairs: Sequence[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """One-sided cross spectral densities by Welch's method, and their frequencies per sample.

    Hann windows of ``length`` samples, half overlapping, without their means; all windows in one
    transform, which is many times faster than one by one.
    """
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    seen: dict[int, np.ndarray] = {}
    for x in (x for pair in pairs for x in pair if id(x) not in seen):
        seen[id(x)] = _transforms(x, window)
    double = np.full(length // 2 + 1, 2.0)
    double[0] = 1.0
    double[-1] = 1.0 if length % 2 == 0 else 2.0
    scale = double / (window @ window)
    made = [np.mean(np.conj(seen[id(a)]) * seen[id(b)], axis=0) * scale for a, b in pairs]
    return np.fft.rfftfreq(length), made


def _transforms(x: np.ndarray, window: np.ndarray) -> np.ndarray:
    parts = sliding_window_view(x, len(window))[:: len(window) - len(window) // 2]
    return np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window)
