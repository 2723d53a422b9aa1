"""A recorded speed that is only the recorded position, differentiated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import coherence

from ..record import Record
from .data import Data, prepare
from .skewed import FARTHEST, sensor_skew

SEGMENT = 256  # samples of one spectrum
LEAST_SEGMENTS = 4
BAND = (0.125, 0.25)  # of the rate: beyond most motion, where a smoothed speed still has digits
TOGETHER = 0.9  # median coherence from which two channels share their noise
LATE = 0.75  # samples, beyond which w is late, as a filter makes it

REPEATED = (
    "w is theta differentiated, its noise included: the model was fitted to theta alone; errors "
    "are counted on w."
)


def on_theta_alone(records: Sequence[Record], data: Data) -> Data | None:
    """The same records fitted to theta alone, where w is no measurement of its own.

    Its noise is that of theta, coloured by a filter; taken for a second sensor's it looks like a
    torque. None where w is one, or is late: that lag is to be found.
    """
    if not repeats(data):
        return None
    lag = sensor_skew(data, FARTHEST)
    if lag is not None and lag.lag < -LATE * data.dt:
        return None
    alone = prepare([replace(r, w=None) for r in records])
    return replace(alone, w=data.y[:, 1])


def repeats(data: Data) -> bool:
    """Whether theta and w share their noise: both are one above the motion's own frequencies."""
    if not (np.isfinite(data.noise.w) and np.isfinite(data.noise.theta)):
        return False
    long = [(a, b) for a, b in data.runs if b - a >= LEAST_SEGMENTS * SEGMENT]
    return bool(long) and all(_together(data.y[a:b]) for a, b in long)


def _together(y: np.ndarray) -> bool:
    """Whether the channels of one run are coherent, differenced until they are no ramps."""
    f, both = coherence(np.diff(y[:, 0], 2), np.diff(y[1:, 1]), nperseg=SEGMENT)
    low, high = BAND
    return float(np.median(both[(f > low) & (f <= high)])) > TOGETHER
