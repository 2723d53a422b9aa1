"""The sensor of a drive as a record shows it: rate, noise and steps."""

from __future__ import annotations

import numpy as np

from ..record import Record
from ..record.signal_noise import sensor_noise, smallest_step
from .encoder import Sensing


def sensing_of(record: Record) -> Sensing:
    """Rate, noise and step of the encoder, and the noise of a speed that was recorded."""
    noise, resolution, speed_noise = 0.0, 0.0, None
    if record.theta is not None:
        noise, resolution = _encoder(record.theta, record.resolution.get("theta", 0.0))
    if record.w is not None:
        speed_noise = sensor_noise(record.w, record.resolution.get("w", 0.0))
    return Sensing(1.0 / record.rate, noise, resolution, speed_noise)


def _encoder(theta: np.ndarray, step: float) -> tuple[float, float]:
    """Noise and step of a position; numbers that are much finer than the noise have no step."""
    step = max(step, smallest_step(theta))
    size = sensor_noise(theta, step)
    if step < 0.1 * size:
        return size, 0.0
    return float(np.sqrt(max(size**2 - step**2 / 12.0, 0.0))), step
