"""Rigid loops in units of their own, many at once: one lane is one loop and one start.

J dw/dt = u - F(w), de/dt = w, u = -(kp e + ki int e + kd w). Units: e in Fs/kp, torque in Fs, time
in 1/wn = sqrt(J/kp). What is left of the gains is delta = kd/sqrt(kp J) and rho = ki/(kp wn); the
linear loop is stable iff delta > rho (Routh).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from .curve import Curve

STEP, PER_OCTAVE, ENOUGH = 0.05, 100, 1e-3  # of an L1 norm: units of time, steps, relative tail
NEAR = 1e-5  # relative distance of two speeds between which a slope is measured


@dataclass(frozen=True)
class Lanes:
    """delta, rho and the unit of speed in rad/s, each (n,); ``fall`` of a speed in rad/s.

    A stick at an error of at most ``calm`` (units) is known to come to rest; a swing beyond
    ``large`` grows without bound. ``drift`` is the speed of a reference (units) in the direction of
    the slip.
    """

    delta: np.ndarray
    rho: np.ndarray
    speed: np.ndarray
    fall: Callable[[np.ndarray], np.ndarray]
    calm: float = 0.0
    large: float = 300.0
    drift: np.ndarray | None = None

    def __getitem__(self, which: np.ndarray) -> Lanes:
        own = (self.delta[which], self.rho[which], self.speed[which])
        drift = None if self.drift is None else self.drift[which]
        return Lanes(*own, self.fall, self.calm, self.large, drift)

    def __len__(self) -> int:
        return len(self.delta)

    def drop(self, a: np.ndarray) -> np.ndarray:
        """1 - F/Fs at the speed a."""
        return self.fall(a * self.speed)

    def steepness(self, a: np.ndarray) -> np.ndarray:
        """dF/da / Fs at the speed a."""
        return (self.drop(a * (1.0 - NEAR)) - self.drop(a * (1.0 + NEAR))) / (2.0 * NEAR * a)


@dataclass(frozen=True)
class Loop:
    """A PID position loop around a rigid drive, and its units."""

    curve: Curve
    J: float
    kp: float
    ki: float
    kd: float

    @property
    def wn(self) -> float:
        """1/s, the frequency that is the unit of time."""
        return float(np.sqrt(self.kp / self.J))

    @property
    def unit(self) -> float:
        """rad, the error at which kp alone breaks away."""
        return self.curve.Fs / self.kp

    def lanes(self, count: int) -> Lanes:
        """So many lanes of this loop."""
        return together([self], count)

    def is_stable(self) -> bool:
        """Whether fast motion decays (Routh): (kd + Fv) kp > ki J with the slope Fv of F there."""
        return (self.kd + self.curve.viscous) * self.kp > self.ki * self.J

    @cached_property
    def matrix(self) -> np.ndarray:
        """The loop without friction: the rates of e, w and the integral's torque by these."""
        gains = [-self.kp / self.J, -self.kd / self.J, 1.0 / self.J]
        return np.array([[0.0, 1.0, 0.0], gains, [-self.ki, 0.0, 0.0]])

    @property
    def reach(self) -> float:
        """The largest error that friction can keep up, in units; inf where fast motion grows."""
        return self.largest[1]

    @cached_property
    def largest(self) -> tuple[float, float]:
        """The largest speed, and error, that friction can keep up about a steady motion, in units.

        |F - Fv w| is bounded: that bound times the L1 norm from torque to each of the linear loop,
        a sum over steps that double as motion gets slower; inf where fast motion grows.
        """
        if not self.is_stable():
            return np.inf, np.inf
        own = self.matrix.copy()
        own[1, 1] -= self.curve.viscous / self.J
        step = STEP / self.wn
        M, x, total = expm(step * own), np.array([0.0, 1.0 / self.J, 0.0]), np.zeros(2)
        last = total + np.inf
        while np.any(last > ENOUGH * total):
            last = np.zeros(2)
            for _ in range(PER_OCTAVE):
                x = M @ x
                last += step * np.abs(x[:2])
            total, M, step = total + last, M @ M, 2.0 * step
        error, speed = total * self.curve.most / self.unit
        return float(speed / self.wn), float(error)


def together(loops: list[Loop], count: int) -> Lanes:
    """``count`` lanes of each loop, one loop after the other; all have one sliding curve."""
    rows = [(g.kd / np.sqrt(g.kp * g.J), g.ki / (g.kp * g.wn), g.unit * g.wn) for g in loops]
    delta, rho, speed = np.repeat(np.array(rows), count, axis=0).T
    return Lanes(delta, rho, speed, loops[0].curve.drop)
