"""What the drive's log holds of a motion: counts, a speed of some kind, a torque of some kind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPEEDS = ("filtered", "ticks", "none")


@dataclass
class Sensors:
    """How the log was recorded."""

    counts: int  # of the encoder in a turn; 0: the position is not logged
    speed: str  # of SPEEDS
    lag: float  # s, of the filter of w
    w_noise: float  # rad/s, white, of the filtered w
    averaged: bool  # the torque is the mean over a row, not the one that is held
    u_noise: float  # share of the RMS torque, white
    eccentricity: float = 0.0  # rad, error of the encoder once in a turn
    turned: float = 0.0  # rad, where it is 0


def log(motion, sensors, rng) -> dict[str, np.ndarray]:
    """The columns t, u, and theta or w or both, in SI units."""
    u = motion.average if sensors.averaged else motion.command
    rms = np.sqrt(np.mean(u**2))
    out = {"t": motion.t, "u": u + sensors.u_noise * rms * rng.standard_normal(len(u))}
    read = motion.theta + sensors.eccentricity * np.sin(motion.theta + sensors.turned)
    if sensors.counts:
        count = 2 * np.pi / sensors.counts
        read = np.floor(read / count) * count
        out["theta"] = read
    if sensors.speed == "filtered":
        out["w"] = motion.filtered + sensors.w_noise * rng.standard_normal(len(u))
    if sensors.speed == "ticks":
        out["w"] = np.diff(read, prepend=read[0]) / motion.t[1]
    return out
