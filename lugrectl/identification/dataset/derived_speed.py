"""Derived sensor detection: a recorded speed that is only the derivative of a position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import coherence, welch

from ...record import Record
from ...record.signal_noise import NORMAL_MAD, sensor_noise
from .dataset import Data, prepare

SEGMENT = 256  # samples of one segment of a spectrum
LEAST_SEGMENTS = 4
BAND = (0.125, 0.25)  # of the rate: above most motion, below where rounding hides a speed
COARSE = 1e-3  # s: a faster log is also averaged to it, as there rounding hides a smoothed speed
# on even stamps at 2 kHz and more a smoothed w reached 0.88 to 0.93, a sensor of its own 0.1
TOGETHER = 0.8  # median coherence from which two channels share their noise
TAPS, SURPRISED = 128, 8192  # samples on either side that predict w; samples that are predicted
SURPRISE = 0.7  # of the power of w's own noise; an independent sensor has 1
TWICE_DIFFERENCED = np.sqrt(6.0)  # std of white noise of unit variance, differenced twice
FAST, SLOWER = (0.35, 0.45), (0.15, 0.25)  # of the rate
RISING = 1.5  # ratio of the noise's power in these bands; for a difference it is 2 to 3
PASSED = 0.01  # the same ratio, below which w was low-pass filtered
NULL, HALF = (0.46, 0.5), (0.25, 0.35)  # of the rate: in NULL central differences have no power
SEEN_THERE = 0.1  # ratio of the noise's power in these bands; for central differences 0.02 to 0.03

REPEATED = (
    "w is the derivative of theta, as both have the same noise. The model was fitted to theta "
    "alone; errors are computed on w."
)
DIFFERENCED = (
    "By its noise, w is a difference of positions from sample to sample. The model was fitted to "
    "that position; errors are computed on w."
)


def on_theta_alone(records: Sequence[Record], data: Data) -> tuple[Data, str] | None:
    """Data for a fit to the position alone and a message, if w is no independent measurement.

    The noise of such a w is that of the position, coloured by a filter; as noise of a sensor it
    would look like a torque. None if w is a sensor.
    """
    if differenced(data):
        summed = replace(prepare([_summed(r) for r in records]), w=data.y[:, 1], plain=data.plain)
        return summed, DIFFERENCED
    if not repeats(data):
        return None
    alone = replace(prepare([replace(r, w=None) for r in records]), plain=data.plain)
    return replace(alone, w=data.y[:, 1]), REPEATED


def _summed(record: Record) -> Record:
    assert record.w is not None
    return replace(record, w=None, theta=np.cumsum(record.w) * record.dt)


def differenced(data: Data) -> bool:
    """True if the noise of w, recorded without theta, rises with frequency like a difference's."""
    if not np.isfinite(data.noise.w) or np.isfinite(data.noise.theta):
        return False
    long = _long(_runs(data))
    return bool(long) and all(_rises(y[:, 1]) for y in long)


def _rises(w: np.ndarray) -> bool:
    """True if the noise is that of plain or of central differences."""
    fast, slower, null, half = _powers(w, FAST, SLOWER, NULL, HALF)
    central = null < SEEN_THERE * half and half > 0.5 * slower
    return fast > RISING * slower or central


def filtered(data: Data) -> bool:
    """True if w was low-pass filtered: its noise is then not white, whatever the model."""
    if not np.isfinite(data.noise.w):
        return False
    return any(_falls(y[:, 1]) for y in _long(_runs(data)))


def _falls(w: np.ndarray) -> bool:
    fast, slower = _powers(w, FAST, SLOWER)
    return fast < PASSED * slower


def _powers(w: np.ndarray, *bands: tuple[float, float]) -> list[float]:
    """Median power of w in each band of frequencies (relative to the rate)."""
    f, power = welch(np.diff(w), nperseg=SEGMENT)
    power = power[1:] / np.sin(np.pi * f[1:]) ** 2
    return [float(np.median(power[(f[1:] > low) & (f[1:] <= high)])) for low, high in bands]


def repeats(data: Data) -> bool:
    """True if theta and w share their noise: they are coherent above the frequencies of motion."""
    if not (np.isfinite(data.noise.w) and np.isfinite(data.noise.theta)):
        return False
    every = max(1, round(COARSE / data.dt))
    coarse = [[_means(y, n) for y in _runs(data)] for n in {1, every}]
    return any(long and all(map(_together, long)) for long in map(_long, coarse))


def _means(y: np.ndarray, every: int) -> np.ndarray:
    """Means of ``every`` samples: in a fast log, single samples of a smooth speed are dominated
    by rounding."""
    return y[: len(y) // every * every].reshape(-1, every, 2).mean(1)


def _runs(data: Data) -> list[np.ndarray]:
    return [data.y[a:b] for a, b in data.runs]


def _long(runs: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The runs that are long enough for a spectrum."""
    return [y for y in runs if len(y) >= LEAST_SEGMENTS * SEGMENT]


def _together(y: np.ndarray) -> bool:
    """True if the channels of one run share their noise.

    Then they are coherent at frequencies with hardly any motion. A fast motion makes two
    independent sensors coherent as well. So it is also required that theta predicts w with an
    error below the noise of w, or that w was low-pass filtered.
    """
    return are_coherent(y) and (_falls(y[:, 1]) or _surprise(y) < SURPRISE)


def _surprise(y: np.ndarray) -> float:
    """Power of w that theta around a sample does not predict, over that of the noise of w.

    About 1 if w has its own noise. Cross-validated between the halves of a stretch; from medians.
    """
    middle = len(y) // 2
    part = y[max(0, middle - SURPRISED // 2) : middle + SURPRISED // 2]
    theta, w = np.diff(part[:, 0], 3), np.diff(part[1:, 1], 2)
    taps = min(TAPS, len(w) // 16)
    X = np.lib.stride_tricks.sliding_window_view(theta, 2 * taps + 1)
    w = w[taps : len(w) - taps]
    halves = np.array_split(np.arange(len(w)), 2)
    missed = [
        w[own] - X[own] @ np.linalg.lstsq(X[other], w[other], rcond=1e-12)[0]
        for own, other in (halves, halves[::-1])
    ]
    size = float(np.median(np.abs(np.concatenate(missed)))) / NORMAL_MAD / TWICE_DIFFERENCED
    return (size / sensor_noise(y[:, 1])) ** 2


def are_coherent(y: np.ndarray) -> bool:
    """True if the channels, differenced to remove ramps, are coherent in ``BAND``."""
    f, both = coherence(np.diff(y[:, 0], 2), np.diff(y[1:, 1]), nperseg=SEGMENT)
    low, high = BAND
    return float(np.median(both[(f > low) & (f <= high)])) > TOGETHER
