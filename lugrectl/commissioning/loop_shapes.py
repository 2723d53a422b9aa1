"""The gains with the most integral action at which every member of the band keeps its distance.

    L = G (kp + ki I + kd D) N        |1 + L| - |C| radius >= 1/Ms  at all frequencies

A shape is the place of the controller's zeros about its crossover c = kd/J: their geometric mean
m c and their damping zeta. Of each shape c is raised from far below until the distance is first
kept no more. Most integral action under a bound on Ms: Astrom, Panagopoulos and Hagglund,
Automatica 34(5), 1998.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..hunting.loop import cascade_as_pid, edge
from ..linear import bandwidth_check
from .loop_axis import Axis
from .runs import point

STRUCTURES = ("P-PI", "PID", "PI")
MEAN, ZETA = np.geomspace(0.03, 1.2, 11), (0.7, 1.0, 1.3, 1.7, 2.5)  # shapes that are tried first
LEAST_ZETA = {"P-PI": 1.0, "PID": 0.7, "PI": 1.0}  # a P-PI has real zeros
STEPS, HALVINGS = 40, 12  # of c from the lowest to the highest, and then
CLOSE = 1.0 + 5e-7  # ratio of two c between which the bandwidth is that asked
ROUNDS, SPREAD = 4, 1.6  # of finer shapes about the best, at first by such factors
NOTCHES = [(d, depth) for d in (0.3, 0.8) for depth in (0.1, 0.3)]  # damping, depth
PAYS = 1.1  # times as fast


class Notch(NamedTuple):
    """As :func:`lugrectl.notch` and ``cascade_loop(notch=)`` take it; the frequency in Hz."""

    frequency: float
    damping: float
    depth: float

    def system(self, dt: float | None) -> Any:
        """The transfer function; of a sampled controller by the bilinear transform."""
        W = 2.0 * np.pi * self.frequency
        num, den = ([1.0, 2.0 * d * self.damping * W, W**2] for d in (self.depth, 1.0))
        made: Any = ct.tf(num, den)
        if dt is None:
            return made
        return ct.sample_system(made, dt, "bilinear", prewarp_frequency=W)


class Gains(NamedTuple):
    """Of u = -(kp e + ki int e + kd w), floats or (m,)."""

    kp: Any
    ki: Any
    kd: Any

    def system(self, dt: float | None, notch: Notch | None) -> Any:
        """From the error to -u: kp + ki I + kd D."""
        integral, speed = parts(dt)
        made = self.kp + self.ki * integral
        made = made + self.kd * speed if self.kd else made
        return made if notch is None else made * notch.system(dt)


class Cascade(NamedTuple):
    """u = -(kp + ki int)(kv e + w): kv in 1/s, kp in N m s/rad, ki in N m/rad."""

    kv: Any
    kp: Any
    ki: Any

    def pid(self, dt: float | None) -> Gains:
        """The PID that it is; sampled, w is a difference and the integral that of trapezoids."""
        return Gains(*cascade_as_pid(*self, dt or 0.0))


class Shape(NamedTuple):
    """The crossover c in rad/s, and the place of the zeros about it."""

    c: Any
    mean: Any
    zeta: Any


@dataclass(frozen=True, eq=False)
class Search:
    """An axis and what is asked of its loop; ``share`` is that of the shape's integral action,
    ``asked`` a bandwidth in rad/s in place of the highest."""

    axis: Axis
    structure: str
    Ms: float
    notch: Notch | None = None
    share: float = 1.0
    asked: float | None = None

    def gains(self, shape: Shape) -> Gains:
        """Those of one shape, or of many."""
        if self.structure != "PID":
            return self.cascade(shape).pid(self.axis.dt)
        kd, turn = self.axis.J * shape.c, shape.mean * shape.c
        return Gains(2.0 * shape.zeta * turn * kd, self.share * kd * turn**2, kd)

    def cascade(self, shape: Shape) -> Cascade:
        """Of a P-PI; of a PI without the position loop."""
        kp, turn = self.axis.J * shape.c, shape.mean * shape.c
        if self.structure == "PI":
            return Cascade(0.0, kp, self.share * kp * turn)
        spread = np.sqrt(shape.zeta**2 - 1.0)
        kv, ki = turn * (shape.zeta - spread), kp * turn * (shape.zeta + spread)
        return Cascade(kv, kp, self.share * ki)

    @cached_property
    def _parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Notch, and with it integral and derivative, at the frequencies of the axis."""
        at, dt = point(self.axis.w, self.axis.dt), self.axis.dt
        filtered = np.ones(len(at)) if self.notch is None else self.notch.system(dt)(at)
        integral, speed = (filtered * part(at) for part in parts(dt))
        return filtered, integral, speed

    def controller(self, g: Gains) -> np.ndarray:
        """C (m, n) at the frequencies of the axis."""
        return np.column_stack(np.broadcast_arrays(*map(np.atleast_1d, g))) @ np.array(self._parts)

    def bandwidth(self, shape: Shape) -> float:
        """Where the answer to the reference first falls below -3 dB, rad/s; inf: beyond the axis
        that is known."""
        g, w, dt = self.gains(shape), self.axis.w[self.axis.known], self.axis.dt
        kv = self.cascade(shape).kv if self.structure == "P-PI" else 0.0
        L, part = self.loop(g), of_reference(self.structure, g, kv, w, dt)
        return float(bandwidth_check(ct.frd(L / (1.0 + L) * part, w)).bandwidth)

    def loop(self, g: Gains) -> np.ndarray:
        """L where the axis is known."""
        return (self.axis.G * self.controller(g)[0])[self.axis.known]

    def distance(self, C: np.ndarray) -> np.ndarray:
        """The least |1 + L| of all members of the band (m,), with controllers C (m, n)."""
        return np.min(np.abs(1.0 + self.axis.G * C) - np.abs(C) * self.axis.radius, axis=1)

    @property
    def lowest(self) -> float:
        """Where c begins: below the corner of viscous friction a position loop is of another
        kind."""
        first = 10.0 * float(self.axis.w[self.axis.known][0])
        return first if self.structure == "PI" else max(first, self.axis.corner)

    def highest(self, mean: np.ndarray, zeta: np.ndarray) -> np.ndarray:
        """The c (m,) at which the distance is first kept no more; 0 where it never is, nan where
        nothing ends it."""
        last = self.axis.w[self.axis.known][-1]
        low, high = np.zeros(len(mean)), np.full(len(mean), np.nan)
        for c in np.geomspace(self.lowest, last, STEPS):
            rising = np.isnan(high)
            kept = rising & self._keeps(Shape(c, mean, zeta))
            high[rising & ~kept & (low > 0.0)], low[kept] = c, c
        endless = np.isnan(high) & (low > 0.0)
        for _ in range(HALVINGS):
            c = np.sqrt(low * high)
            kept = self._keeps(Shape(c, mean, zeta))
            low, high = np.where(kept, c, low), np.where(kept, high, c)
        return np.where(endless, np.nan, low)

    def _keeps(self, shape: Shape) -> np.ndarray:
        """Whether the loop is stable (Nyquist) and keeps the distance, (m,)."""
        C, known = self.controller(self.gains(shape)), self.axis.known
        turned = np.unwrap(np.angle(1.0 + C[:, known] * self.axis.G[known]))
        first = turned[:, 0] - 2.0 * np.pi * (turned[:, 0] > 0.0)  # of up to three integrators
        ends = first + turned[:, -1] - turned[:, 0]
        return (np.abs(ends) < 0.5 * np.pi) & (self.distance(C) >= 1.0 / self.Ms)

    def best(self, about: Shape | None = None) -> Shape:
        """The shape with the most integral action, of all or near one; its c is 0 where no gains
        keep the distance, nan where nothing ends them."""
        found = self.at(about or self._best_of(MEAN, np.array(ZETA)))
        for k in range(ROUNDS):
            spread = SPREAD ** (np.linspace(-1.0, 1.0, 5) / 2**k)
            near = self._best_of(found.mean * spread, found.zeta * spread)
            found = max(near, found, key=self.action)
        return found

    def _best_of(self, mean: np.ndarray, zeta: np.ndarray) -> Shape:
        zeta = np.unique(np.maximum(zeta, LEAST_ZETA[self.structure]))
        m, z = (x.ravel() for x in np.meshgrid(mean, zeta[: 1 if self.structure == "PI" else None]))
        made = [Shape(*x) for x in zip(self.highest(m, z), m, z, strict=True)]
        return max(made, key=self.action)

    def at(self, shape: Shape) -> Shape:
        """The shape at its highest c."""
        return shape._replace(c=self.highest(*np.array([[shape.mean], [shape.zeta]]))[0])

    def placed(self, shape: Shape) -> Shape:
        """The shape at its highest c, or below it at the bandwidth that is asked."""
        found = self.at(shape)
        if self.asked is None or not found.c or self.bandwidth(found) <= self.asked:
            return found

        def is_slower(c: float) -> bool:
            return self.bandwidth(shape._replace(c=c)) <= float(self.asked or 0.0)

        return shape._replace(c=edge(is_slower, self.lowest, found.c, CLOSE)[0])

    def action(self, shape: Shape) -> float:
        """ki, or kp of a speed loop's PID: infinite where nothing ends it."""
        made = self.gains(shape)
        size = made.kp if self.structure == "PI" else made.ki
        return np.inf if np.isnan(size) else float(size)

    def with_notch(self, plain: Shape) -> tuple[Search, Shape, float]:
        """The search and shape with the notch that pays most, and how much faster the integral
        action is with it; the same where none pays."""
        order = 2.0 if self.structure == "PI" else 3.0
        end = np.inf if self.axis.dt is None else 0.9 * np.pi / self.axis.dt
        peaks, best = [peak for peak in self.axis.peaks if peak < end], (self, plain, 1.0)
        for peak, (damping, depth) in product(peaks, NOTCHES):
            one = replace(self, notch=Notch(peak / (2.0 * np.pi), damping, depth))
            shape = one.best(plain)
            ratio = (self.action(shape) / self.action(plain)) ** (1.0 / order)
            if ratio > max(PAYS, best[2]):
                best = (one, shape, ratio)
        return best


def parts(dt: float | None) -> tuple[Any, Any]:
    """Return I and D: 1/s and s; of a sampled controller trapezoids, and the difference."""
    if dt is None:
        return ct.tf([1.0], [1.0, 0.0]), ct.tf([1.0, 0.0], [1.0])
    return ct.tf([dt / 2, dt / 2], [1.0, -1.0], dt), ct.tf([1 / dt, -1 / dt], [1.0, 0.0], dt)


def of_reference(
    structure: str, g: Gains, kv: float, w: np.ndarray, dt: float | None
) -> np.ndarray:
    """Return the part of the controller that acts on the reference: not its derivative."""
    if structure == "PI":
        return np.ones(len(w))
    integral, speed = (part(point(w, dt)) for part in parts(dt))
    if structure == "P-PI":
        return kv / (kv + speed)
    on_error = g.kp + g.ki * integral
    return on_error / (on_error + g.kd * speed)
