"""A recorded speed that is only a position, differentiated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import coherence, welch

from ..record import Record
from .data import Data, prepare
from .skewed import lateness

SEGMENT = 256  # samples of one spectrum
LEAST_SEGMENTS = 4
BAND = (0.125, 0.25)  # of the rate: beyond most motion, where a smoothed speed still has digits
TOGETHER = 0.9  # median coherence from which two channels share their noise
FAST, SLOWER = (0.35, 0.45), (0.15, 0.25)  # of the rate
RISING = 1.5  # of the noise's power between those; that of a difference rises 2 to 3 times
PASSED = 0.01  # of the noise's power between those, below which a filter took it
NULL, HALF = (0.46, 0.5), (0.25, 0.35)  # of the rate: where central differences see nothing
SEEN_THERE = 0.1  # of the noise's power between those; theirs is 0.02 to 0.03

REPEATED = (
    "w is theta differentiated, its noise included: the model was fitted to theta alone; errors "
    "are counted on w."
)
DIFFERENCED = (
    "w is a position's difference from sample to sample, by its noise: the model was fitted to "
    "that position; errors are counted on w."
)


def on_theta_alone(records: Sequence[Record], data: Data) -> tuple[Data, str] | None:
    """The same records fitted to the position alone, where w is no measurement of its own.

    Its noise is that of the position, coloured by a filter; taken for a sensor's it looks like a
    torque. With what is to be said of it; None where w is a sensor's.
    """
    if differenced(data):
        return replace(prepare([_summed(r) for r in records]), w=data.y[:, 1]), DIFFERENCED
    if not repeats(data):
        return None
    alone = prepare([replace(r, w=None) for r in records])
    return replace(alone, w=data.y[:, 1], late=lateness(data)), REPEATED


def _summed(record: Record) -> Record:
    assert record.w is not None
    return replace(record, w=None, theta=np.cumsum(record.w) * record.dt)


def differenced(data: Data) -> bool:
    """Whether the noise of w, recorded without theta, rises as a difference's does."""
    if not np.isfinite(data.noise.w) or np.isfinite(data.noise.theta):
        return False
    long = _long(data)
    return bool(long) and all(_rises(data.y[a:b, 1]) for a, b in long)


def _rises(w: np.ndarray) -> bool:
    """Whether the noise is that of plain differences, or of central ones."""
    fast, slower, null, half = _powers(w, FAST, SLOWER, NULL, HALF)
    central = null < SEEN_THERE * half and half > 0.5 * slower
    return fast > RISING * slower or central


def filtered(data: Data) -> bool:
    """Whether w went through a low-pass filter: its noise is not white then, whatever the model."""
    if not np.isfinite(data.noise.w):
        return False
    return any(_falls(data.y[a:b, 1]) for a, b in _long(data))


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
    long = _long(data)
    return bool(long) and all(_together(data.y[a:b]) for a, b in long)


def _long(data: Data) -> list[tuple[int, int]]:
    """The runs that are long enough for a spectrum."""
    return [(a, b) for a, b in data.runs if b - a >= LEAST_SEGMENTS * SEGMENT]


def _together(y: np.ndarray) -> bool:
    """Whether the channels of one run are coherent, differenced until they are no ramps."""
    f, both = coherence(np.diff(y[:, 0], 2), np.diff(y[1:, 1]), nperseg=SEGMENT)
    low, high = BAND
    return float(np.median(both[(f > low) & (f <= high)])) > TOGETHER
