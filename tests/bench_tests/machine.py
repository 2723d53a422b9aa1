"""One axis with friction that sticks: Stribeck friction in motion, any torque up to Fs at rest.

J dw/dt = u - F(w) - c(theta), F = +-(Fc + (Fs - Fc) exp(-(w/vs)^2)) + Fv w. The torque is held
from sample to sample. Stops are located in time; a release can only fall on a sample, since at
rest nothing changes between two of them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from math import exp, inf, sin

import numpy as np
from scipy.optimize import brentq

Program = Generator[float, tuple[float, float], None]  # yields u, is sent (theta, w)


@dataclass
class Machine:
    """The axis. ``Fs`` holds for both directions unless ``backward`` is given."""

    J: float
    Fc: float
    Fs: float
    Fv: float
    vs: float
    backward: float | None = None  # Fs against negative motion
    waves: tuple[tuple[float, float, float], ...] = ()  # (N, amplitude, phase): c(theta)
    variation: float = 0.0  # share of Fs, once per turn

    def c(self, theta: float) -> float:
        return sum(a * sin(n * theta + phase) for n, a, phase in self.waves)

    def static(self, theta: float, s: int) -> float:
        """Fs at this place and in this direction."""
        Fs = self.Fs if s > 0 or self.backward is None else self.backward
        return Fs * (1 + self.variation * sin(theta)) if self.variation else Fs

    def friction(self, w: float) -> float:
        """F at a speed that is not 0."""
        return self.Fc + (self.Fs - self.Fc) * exp(-((w / self.vs) ** 2)) + self.Fv * abs(w)

    @property
    def step(self) -> float:
        """A step that is short against the fall of friction over vs."""
        largest = max(self.Fs, self.backward or 0.0) * (1 + self.variation)
        steepest = 0.86 * (largest - self.Fc) / self.vs + self.Fv
        return 0.1 * self.J / steepest if steepest else inf


def simulate(machine: Machine, program: Program, dt: float, theta: float = 0.0, w: float = 0.0):
    """(u, theta, w) at the samples; u[k] acts from sample k to the next."""
    rows = []
    u = next(program)
    while True:
        rows.append((u, theta, w))
        theta, w = advance(machine, theta, w, u, dt)
        try:
            u = program.send((theta, w))
        except StopIteration:
            return np.array(rows).T


def advance(machine: Machine, theta: float, w: float, u: float, dt: float) -> tuple[float, float]:
    """The state after ``dt`` under the torque u."""
    left, longest = dt, machine.step
    s = 1 if w > 0 else -1
    while left > 1e-12:
        if w == 0.0:
            drive = u - machine.c(theta)
            s = 1 if drive > 0 else -1
            if abs(drive) <= machine.static(theta, s):
                return theta, 0.0
        h = min(left, longest)
        rate = acceleration(machine, theta, u, s)
        after = rk4(rate, theta, w, h)
        if after[1] * s <= 0:
            h, after = stop(rate, theta, w, h)
        left -= h
        theta, w = after
    return theta, w


def acceleration(machine: Machine, theta: float, u: float, s: int) -> Callable:
    """dw/dt of (theta, w) for motion in the direction s."""
    J, Fc, Fv, vs, waves = machine.J, machine.Fc, machine.Fv, machine.vs, machine.waves
    drop = machine.static(theta, s) - Fc

    def rate(theta: float, w: float) -> float:
        force = u - s * (Fc + drop * exp(-((w / vs) ** 2))) - Fv * w
        for n, a, phase in waves:
            force -= a * sin(n * theta + phase)
        return force / J

    return rate


def rk4(rate: Callable, theta: float, w: float, h: float) -> tuple[float, float]:
    """A step of the classical Runge-Kutta method."""
    a1 = rate(theta, w)
    w2 = w + h / 2 * a1
    a2 = rate(theta + h / 2 * w, w2)
    w3 = w + h / 2 * a2
    a3 = rate(theta + h / 2 * w2, w3)
    w4 = w + h * a3
    a4 = rate(theta + h * w3, w4)
    return theta + h / 6 * (w + 2 * (w2 + w3) + w4), w + h / 6 * (a1 + 2 * (a2 + a3) + a4)


def stop(rate: Callable, theta: float, w: float, h: float) -> tuple[float, tuple[float, float]]:
    """When and where the axis comes to rest within the step h."""
    if w != 0.0:
        h = brentq(lambda part: rk4(rate, theta, w, part)[1], 0.0, h, xtol=1e-14)
    return h, (rk4(rate, theta, w, h)[0], 0.0)
