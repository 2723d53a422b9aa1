"""Steady sliding w = v of a position loop, and how fast a small deviation from it decays."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from ..blocks.model import Model
from ..core.errors import Refused
from .bristles import known
from .lanes import Loop

NEAR = 1e-6  # relative step of a difference
SPEEDS = np.geomspace(1e4, 1e-8, 400)  # rad/s, at which sliding is looked at
ROUNDING = 1e-6  # of wn: elements that slip together have an eigenvalue of 0
BENDS = 100.0  # times its bend that a bristle is dragged


class Sliding:
    """The loop linearized about steady sliding.

    The states are e, w, the integral's torque and those of the friction, which rest at dz/dt = 0.
    """

    def __init__(self, model: Model, loop: Loop) -> None:
        self.loop, self.law, self.z = loop, model.friction.block, np.zeros(0)
        self.values = self.law.defaults() | dict(model.friction.values)
        self.bend = 0.0
        if self.law.states:
            if not known(model):
                raise Refused(f"{self.law.name} is no law of w with sigma0: stick-slip is unknown.")
            self.bend = loop.curve.Fs / float(self.values["sigma0"] or 0.0)

    def friction(self, w: float, z: np.ndarray) -> np.ndarray:
        """F and dz/dt."""
        if not self.law.states:
            return np.array([float(self.loop.curve.torque(np.array([w]))[0])])
        return np.array(self.law(w, *z, **self.values), float)

    def bent(self, v: float) -> np.ndarray:
        """z in steady sliding, found from that of the speed before."""
        count = len(self.law.states)
        if count and not len(self.z):
            span = (0.0, BENDS * self.bend / v)
            done = solve_ivp(lambda t, z: self.friction(v, z)[1:], span, np.zeros(count), "LSODA")
            self.z = done.y[:, -1]
        if count:
            done = root(lambda z: self.friction(v, z * self.bend)[1:], self.z / self.bend)
            self.z = done.x * self.bend
        return self.z

    def growth(self, v: float) -> float:
        """The largest real part of an eigenvalue, 1/s; a rounding error counts as decay."""
        loop, z = self.loop, self.bent(v)
        at = np.r_[v, z]
        steps = NEAR * np.r_[v, np.full(len(z), self.bend)]
        ends = [[self.friction(x[0], x[1:]) for x in (at + d, at - d)] for d in np.diag(steps)]
        slope = np.array([(a - b) / (2.0 * d) for (a, b), d in zip(ends, steps, strict=True)]).T
        A = np.zeros((3 + len(z), 3 + len(z)))
        A[:3, :3] = loop.matrix
        A[1, [1, *range(3, len(A))]] -= slope[0] / loop.J
        A[3:, [1, *range(3, len(A))]] = slope[1:]
        if not loop.ki:
            A = np.delete(np.delete(A, 2, 0), 2, 1)
        return float(np.linalg.eigvals(A).real.max()) - ROUNDING * loop.wn

    def profile(self) -> tuple[np.ndarray, np.ndarray]:
        """The growth at falling speeds."""
        return SPEEDS, np.array([self.growth(v) for v in SPEEDS])

    def first_speed(self, v: np.ndarray, growth: np.ndarray) -> float:
        """The speed below which sliding is unstable; 0: at none."""
        unstable = np.flatnonzero(growth > 0.0)
        if not len(unstable) or not unstable[0]:
            return float(v[0]) if len(unstable) else 0.0
        return float(brentq(self.growth, v[unstable[0]], v[unstable[0] - 1]))  # type: ignore
