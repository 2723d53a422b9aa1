"""A recorded speed that is only a position, differentiated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import coherence, welch

from ..record import Record
from .data import Data, prepare
from .noise import NORMAL_MAD, sensor_noise
from .skewed import lateness

SEGMENT = 256  # samples of one spectrum
LEAST_SEGMENTS = 4
BAND = (0.125, 0.25)  # of the rate: beyond most motion, where a smoothed speed still has digits
COARSE = 1e-3  # s, over which a faster log is averaged, too: such a speed has no digits in it
# on even stamps at 2 kHz and more a smoothed w reached 0.88 to 0.93, a sensor of its own 0.1
TOGETHER = 0.8  # median coherence from which two channels share their noise
TAPS, SURPRISED = 128, 8192  # samples on either side that foretell w; samples that are foretold
SURPRISE = 0.7  # of the power of w's own noise; a sensor of its own has 1
TWICE_DIFFERENCED = np.sqrt(6.0)  # of white noise
FAST, SLOWER = (0.35, 0.45), (0.15, 0.25)  # of the rate
RISING = 1.5  # of the noise's power between those; that of a difference rises 2 to 3 times
PASSED = 0.01  # of the noise's power between those, below which a filter took it
NULL, HALF = (0.46, 0.5), (0.25, 0.35)  # of the rate: where central differences see nothing
SEEN_THERE = 0.1  # of the noise's power between those; theirs is 0.02 to 0.03

REPEATED = (
    "w is theta differentiated, its noise included: the model was fitted to theta alone; errors "
    "are counted on w."
)
UNEVEN = (
    "On t's uneven stamps w does not go with theta: the model was fitted to theta alone; errors "
    "are counted on w."
)
DIFFERENCED = (
    "w is a position's difference from sample to sample, by its {}: the model was fitted to that "
    "position; errors are counted on w."
)


def on_theta_alone(
    records: Sequence[Record], data: Data, *, halfway: bool = False, uneven: bool = False
) -> tuple[Data, str] | None:
    """The same records fitted to the position alone, where w is no measurement of its own.

    Its noise is that of the position, coloured by a filter; taken for a sensor's it looks like a
    torque. With what is to be said of it; None where w is a sensor's. A w that was found to be
    ``halfway`` between samples is a difference, whatever its noise; one whose noise the stamps'
    ``uneven`` steps made is left out.
    """
    if halfway or differenced(data):
        summed = replace(prepare([_summed(r) for r in records]), w=data.y[:, 1])
        return summed, DIFFERENCED.format("lateness" if halfway else "noise")
    if not (uneven or repeats(data)):
        return None
    alone = prepare([replace(r, w=None) for r in records])
    return replace(alone, w=data.y[:, 1], late=lateness(data)), UNEVEN if uneven else REPEATED


def _summed(record: Record) -> Record:
    assert record.w is not None
    return replace(record, w=None, theta=np.cumsum(record.w) * record.dt)


def differenced(data: Data) -> bool:
    """Whether the noise of w, recorded without theta, rises as a difference's does."""
    if not np.isfinite(data.noise.w) or np.isfinite(data.noise.theta):
        return False
    long = _long(_runs(data))
    return bool(long) and all(_rises(y[:, 1]) for y in long)


def _rises(w: np.ndarray) -> bool:
    """Whether the noise is that of plain differences, or of central ones."""
    fast, slower, null, half = _powers(w, FAST, SLOWER, NULL, HALF)
    central = null < SEEN_THERE * half and half > 0.5 * slower
    return fast > RISING * slower or central


def filtered(data: Data) -> bool:
    """Whether w went through a low-pass filter: its noise is not white then, whatever the model."""
    if not np.isfinite(data.noise.w):
        return False
    return any(_falls(y[:, 1]) for y in _long(_runs(data)))


def _falls(w: np.ndarray) -> bool:
    fast, slower = _powers(w, FAST, SLOWER)
    return fast < PASSED * slower


def _powers(w: np.ndarray, *bands: tuple[float, float]) -> list[float]:
    """Median power of w in each band of frequencies, over the rate."""
    f, power = welch(np.diff(w), nperseg=SEGMENT)
    power = power[1:] / np.sin(np.pi * f[1:]) ** 2
    return [float(np.median(power[(f[1:] > low) & (f[1:] <= high)])) for low, high in bands]


def repeats(data: Data) -> bool:
    """Whether theta and w share their noise: both are one above the motion's own frequencies."""
    if not (np.isfinite(data.noise.w) and np.isfinite(data.noise.theta)):
        return False
    every = max(1, round(COARSE / data.dt))
    coarse = [[_means(y, n) for y in _runs(data)] for n in {1, every}]
    return any(long and all(map(_together, long)) for long in map(_long, coarse))


def _means(y: np.ndarray, every: int) -> np.ndarray:
    """Of so many samples each: of a smooth speed in a fast log the samples themselves tell little
    beside rounding."""
    return y[: len(y) // every * every].reshape(-1, every, 2).mean(1)


def _runs(data: Data) -> list[np.ndarray]:
    return [data.y[a:b] for a, b in data.runs]


def _long(runs: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Those that are long enough for a spectrum."""
    return [y for y in runs if len(y) >= LEAST_SEGMENTS * SEGMENT]


def _together(y: np.ndarray) -> bool:
    """Whether the channels of one run share their noise.

    They are coherent then, where there is hardly any motion; and as a fast motion makes two
    sensors coherent, too, w must be foretold by theta to less than its own noise, or have none
    of its own beyond a filter.
    """
    return _coherent(y) and (_falls(y[:, 1]) or _surprise(y) < SURPRISE)


def _surprise(y: np.ndarray) -> float:
    """What theta around a sample does not tell of w, over the noise of w: power, 1 if that is its
    own. Median, of halves of a stretch by the weights that the other half gives."""
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


def _coherent(y: np.ndarray) -> bool:
    """Whether the channels are one in a band, differenced until they are no ramps."""
    f, both = coherence(np.diff(y[:, 0], 2), np.diff(y[1:, 1]), nperseg=SEGMENT)
    low, high = BAND
    return float(np.median(both[(f > low) & (f <= high)])) > TOGETHER
