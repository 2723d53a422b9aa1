"""Friction on the load of an elastic axis, as the motor feels it.

    J2 dw2/dt = K (theta - theta2) + D (w - w2) - F2

The load's motion follows from the measured one of the motor; F2 costs the motor the torque
H F2 with H = (2 za wa s + wa^2)/(s^2 + 2 za wa s + wa^2), wa and za of the first antiresonance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..blocks.bristle_laws import strokes
from .modes import Mechanics
from .runs import FINER, Run

STEP = 0.3  # rad of the fastest oscillation in a step, at most
SHORTEST = 1e-3  # of the distance between the load's reversals: a bristle stiffer than this


@dataclass(frozen=True, eq=False)
class LoadMotion:
    """Steps and speed (FINER n,) of the load in the parts of intervals, and H (M,) at the bins."""

    steps: np.ndarray
    speed: np.ndarray
    seen: np.ndarray

    @cached_property
    def strokes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return strokes(self.steps)


def load_motion(run: Run, mechanics: Mechanics, friction: float, distance: float) -> LoadMotion:
    """The motion of the load, with about so much friction (N m or N) on it."""
    wa, za, ratio, _ = np.exp(mechanics.pairs[0]).tolist()
    share = 1.0 - 1.0 / (1.0 + ratio) ** 2  # of the inertia, on the load
    steps, speed = _integrated(run, wa, za, friction / (share * mechanics.inertia[0]), distance)
    s = 1j * run.w
    seen = (2.0 * za * wa * s + wa**2) / (s**2 + 2.0 * za * wa * s + wa**2)
    return LoadMotion(steps, speed, seen)


def _integrated(
    run: Run, wa: float, za: float, braking: float, distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Steps and speed of the load; ``braking`` is its friction over its inertia."""
    path, first, _ = run.strokes
    distance = max(distance, SHORTEST * path[-1] / max(len(first), 1))
    part = run.dt / FINER
    many = math.ceil(part * max(wa, math.sqrt(braking / distance)) / STEP)
    h, k, d = part / many, wa**2, 2.0 * za * wa
    x, v, z = float(run.theta[0]), 0.0, 0.0
    steps, speeds = [], []
    fine = np.arange(FINER * len(run.theta)) / FINER
    angles = np.interp(fine, np.arange(len(run.theta)), run.theta)
    for now, after in zip(angles[:-1].tolist(), angles[1:].tolist(), strict=True):
        begin, w = x, (after - now) / part
        for i in range(many):
            end = math.copysign(1.0, v)
            z = end + (z - end) * math.exp(-abs(v) * h / distance)
            v += h * (k * (now + w * h * (i + 0.5) - x) + d * (w - v) - braking * z)
            x += h * v
        steps.append(x - begin)
        speeds.append(v)
    return np.array([*steps, 0.0]), np.array([*speeds, v])
