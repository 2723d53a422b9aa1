"""A drive for short bench tests, in a few lines and with nothing of the package: it sticks exactly.

The torque is a function of the row, the angle as the encoder counts it, and the speed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Torque = Callable[[int, float, float], float]


@dataclass(frozen=True)
class Drive:
    J: float = 0.003
    Fc: float = 0.15
    Fs: float = 0.2
    vs: float = 0.1
    Fv: float = 0.01
    gravity: float = 0.0
    cogging: float = 0.0
    harmonic: int = 7
    counts: int = 16384
    dt: float = 2e-3

    def run(self, torque: Torque, rows: int, x: float = 0.0, v: float = 0.0) -> dict:
        """A log of so many rows with t, u, theta and w; ``w`` is true, ``theta`` is counted."""
        count, h, log = 2 * np.pi / self.counts, self.dt / 10, np.zeros((rows, 4))
        for k in range(rows):
            seen = np.floor(x / count) * count
            u = torque(k, seen, v)
            log[k] = k * self.dt, u, seen, v
            for _ in range(10):
                x, v = self._step(x, v, u, h)
        return dict(zip(("t", "u", "theta", "w"), log.T, strict=True))

    def _step(self, x: float, v: float, u: float, h: float) -> tuple[float, float]:
        middle = x + 0.5 * h * v
        u -= self.gravity * np.sin(middle) + self.cogging * np.sin(self.harmonic * middle)
        if v == 0.0 and abs(u) <= self.Fs:
            return x, v
        level = self.Fc + (self.Fs - self.Fc) * np.exp(-((v / self.vs) ** 2))
        side = np.sign(v) or np.sign(u)
        new = (v + h * (u - side * level) / self.J) / (1 + h * self.Fv / self.J)
        new = 0.0 if v * new < 0 else new
        return x + 0.5 * h * (v + new), new


def kept(log: dict, *channels: str) -> dict:
    return {k: log[k] for k in ("t", "u", *channels)}


def stale(log: dict) -> np.ndarray:
    """The speed as counts over the time since the last edge, which keeps its value without one."""
    w, value, last = np.zeros(len(log["t"])), 0.0, 0
    for k in range(1, len(w)):
        passed = log["theta"][k] - log["theta"][last]
        if passed:
            value, last = passed / (log["t"][k] - log["t"][last]), k
        w[k] = value
    return w


def held(levels: list[float], rows: int) -> Torque:
    """Levels of the torque, each for so many rows, again and again."""
    return lambda k, theta, w: levels[k // rows % len(levels)]


def speed_loop(reference: np.ndarray, J: float, pole: float = 60.0) -> Torque:
    """A PI loop that follows a speed."""
    integral = [0.0]

    def torque(k: int, theta: float, w: float) -> float:
        off = reference[k] - w
        integral[0] += J * pole**2 * off * 2e-3
        return 2 * J * pole * off + integral[0]

    return torque
