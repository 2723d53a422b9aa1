"""The sensor of a sampled drive: an encoder with steps and noise, and a speed or its difference."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np

from ..blocks.block import Steady

WHOLE = 1.5 * 2.0**52  # a number of this size has no fraction: to add and subtract it rounds


@dataclass(frozen=True)
class Sensing:
    """What a drive measures, and how often.

    ``dt`` and ``delay`` in s; ``noise`` of the position in rad and its ``resolution`` in rad,
    0 for none; ``speed_noise`` in rad/s where the drive has a speed of its own, None where it
    takes the difference of two positions.
    """

    dt: float
    noise: float = 0.0
    resolution: float = 0.0
    speed_noise: float | None = None
    delay: float = 0.0

    def errors(self, samples: int, seed: int = 0) -> dict[str, np.ndarray]:
        """The noise of position and speed by the names of the drive's inputs."""
        random = np.random.default_rng(seed)
        sizes = {"n_theta": self.noise, "n_w": self.speed_noise or 0.0}
        return {k: random.normal(0.0, size, samples) for k, size in sizes.items()}

    def still(self) -> Sensing:
        """The same drive without noise, but with the steps of its encoder."""
        return replace(self, noise=0.0, speed_noise=None if self.speed_noise is None else 0.0)

    def quiet(self) -> Sensing:
        """The same drive with an exact sensor."""
        return Sensing(self.dt, 0.0, 0.0, None if self.speed_noise is None else 0.0, self.delay)


@dataclass(frozen=True)
class _Encoder(Steady):
    """theta_m = q round((theta + n_theta)/q), w_m its difference or w + n_w; or the state."""

    step: float
    dt: float
    own: bool
    moves: bool

    def __call__(self, t: Any, x: Any, v: Any, params: Any) -> np.ndarray:
        angle = rounded(v[0] + v[2], self.step)
        if self.moves:
            return np.array([angle])
        return np.array([angle, v[1] + v[3] if self.own else (angle - x[0]) / self.dt])


def rounded(x: Any, step: float) -> Any:
    """x to the nearest multiple of a step, 0 for none; in arithmetic that the engine can trace."""
    return step * ((x / step + WHOLE) - WHOLE) if step else x


def encoder(sensing: Sensing, seen: tuple[str, str] = ("theta", "w")) -> ct.NonlinearIOSystem:
    """The sensor as a block: inputs ``seen``, n_theta, n_w, outputs theta_m, w_m."""
    given = (sensing.resolution, sensing.dt, sensing.speed_noise is not None)
    return ct.nlsys(
        _Encoder(*given, moves=True),
        _Encoder(*given, moves=False),
        inputs=[*seen, "n_theta", "n_w"],
        outputs=["theta_m", "w_m"],
        states=["last"],
        dt=sensing.dt,
        name="encoder",
    )
