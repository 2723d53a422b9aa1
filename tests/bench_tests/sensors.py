"""What the log of a bench test shows of the motion: counts, registers, four kinds of speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPEEDS = ("clean", "difference", "stale", "missing")


@dataclass
class Sensors:
    """How the axis is recorded."""

    rate: float  # Hz
    counts: int  # per turn
    lsb: float  # N m, of the register that u comes from
    noise: float  # N m, of a measured torque; 0: u is the command
    speed: str  # of SPEEDS
    window: int  # samples, of a difference
    speed_noise: float  # rad/s, of a clean speed

    def rounded(self, u: float) -> float:
        return round(u / self.lsb) * self.lsb

    def log(self, u, theta, w, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """The columns, with u as it was applied and the motion at the samples."""
        t = np.arange(len(u)) / self.rate
        if self.noise:
            u = np.round((u + rng.normal(0, self.noise, len(u))) / self.lsb) * self.lsb
        counts = np.floor(theta / (2 * np.pi) * self.counts)
        columns = {"t": t, "u": u, "theta": counts * 2 * np.pi / self.counts}
        if self.speed == "clean":
            columns["w"] = w + rng.normal(0, self.speed_noise, len(w))
        elif self.speed == "difference":
            columns["w"] = difference(columns["theta"], self.window, self.rate)
        elif self.speed == "stale":
            columns["w"] = stale(columns["theta"], self.rate)
        return columns


def difference(theta: np.ndarray, window: int, rate: float) -> np.ndarray:
    """Counts over the last ``window`` samples."""
    before = np.concatenate([np.full(window, theta[0]), theta[:-window]])
    return (theta - before) * rate / window


def stale(theta: np.ndarray, rate: float) -> np.ndarray:
    """From edge to edge; the last value stays while none comes, at rest too."""
    edges = np.flatnonzero(np.diff(theta)) + 1
    values = np.diff(theta[edges]) * rate / np.diff(edges)
    last = np.searchsorted(edges, np.arange(len(theta)), side="right") - 2
    return np.where(last < 0, 0.0, values[np.maximum(last, 0)]) if len(values) else 0 * theta
