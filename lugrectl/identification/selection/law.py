"""Friction along the measured motion, as far as it may have been declared wrongly.

The bristle relaxes over a distance x0 towards the sign of the motion,

    z' = (sign(w) - z) |w| / x0,

exact between reversals. Friction is a sum of shapes of z and w with coefficients above 0: Coulomb
and three Stribeck curves, viscous terms of three exponents, the bristle's damping, and what noise
smears of a reversal. These are nuisance terms: grease or another Stribeck exponent is no effect.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .motion import Fine, Motion
from .numbers import TAIL

GONE = 40.0  # distances after which exp(-x) no longer changes a sum with 1
BENDS = (0.5, 1.0, 2.0, 4.0, 8.0)  # of the declared presliding distance
SPEEDS = (0.5, 0.8, 1.2, 2.0, 4.0)  # of the declared Stribeck speed
FORCES = ("Fc", "dip", "dip 1.5", "dip 5")  # the part that scales with the level of friction
VISCOUS = ("Fv", "grease", "slow Fv")
SMEAR = ("sigma1", "smear")
NAMES = (*FORCES, *VISCOUS, *SMEAR)
GREASE = 0.6  # exponent of shear-thinning grease


@dataclass(frozen=True, eq=False)
class Law:
    """The shapes of friction at one presliding distance and Stribeck speed, (n, shapes)."""

    x0: float
    vs: float
    shapes: np.ndarray

    def part(self, coefficients: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
        """The torque (n,) of some shapes."""
        at = [NAMES.index(k) for k in names]
        return self.shapes[:, at] @ coefficients[at]

    @property
    def z(self) -> np.ndarray:
        return self.shapes[:, 0]


def strokes(dx: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The path, and the first sample and the direction of each stroke between reversals."""
    path, side = np.cumsum(np.abs(dx)), np.sign(dx)
    moving = np.flatnonzero(side)
    if not len(moving):
        return path, moving, side[:0]
    turns = side[moving[1:]] != side[moving[:-1]]
    first = moving[np.append(True, turns)]
    return path, first, side[first]


def bristle(
    path: np.ndarray,
    first: np.ndarray,
    sides: np.ndarray,
    x0: float,
    asymmetry: float = 0.0,
) -> np.ndarray:
    """The bristle torque for a level of 1, or of 1 + asymmetry sign(w).

    The level G sets both the value towards which it relaxes and, as the stiffness stays, the
    distance G x0 over which it does.
    """
    z, last = np.zeros(len(path)), 0.0
    ends = np.append(first[1:], len(path))
    for a, b, side in zip(first.tolist(), ends.tolist(), sides.tolist(), strict=True):
        level = 1.0 + asymmetry * side
        reach, limit = level * x0, side * level
        start = path[a - 1] if a else 0.0
        end = a + int(np.searchsorted(path[a:b], start + GONE * reach))
        z[end:b] = limit
        z[a:end] = limit + (last - limit) * np.exp(-(path[a:end] - start) / reach)
        last = float(z[b - 1])
    return z


@dataclass(eq=False)
class Laws:
    """The laws to choose from on one motion."""

    motion: Motion
    declared: Mapping[str, float]
    rough: float

    def __post_init__(self) -> None:
        self.fine: Fine = self.motion.fine
        self._strokes = strokes(self.fine.dx)
        self._kept: dict[float, np.ndarray] = {}

    def distances(self) -> np.ndarray:
        """Presliding distances to try, rad."""
        known, m = self.declared, self.motion
        if known.get("sigma0") and known.get("Fc"):
            return known["Fc"] / known["sigma0"] * np.array(BENDS)
        reach = float(np.ptp(m.theta))
        far = 2e-3 * min(reach, 4 * np.pi) + 1e-9
        return np.geomspace(min(max(0.5 * m.count, 1e-5 * reach), 0.5 * far), far, 6)

    def speeds(self) -> np.ndarray:
        """Stribeck speeds to try, rad/s."""
        top = self.motion.top
        vs = self.declared.get("vs") or 0.01 * top
        return np.unique(np.clip(vs * np.array(SPEEDS), 1e-4 * top, 0.3 * top))

    def z(self, x0: float, asymmetry: float = 0.0) -> np.ndarray:
        """The bristle at the fine instants."""
        if asymmetry:
            return bristle(*self._strokes, x0, asymmetry)
        if x0 not in self._kept:
            self._kept[x0] = bristle(*self._strokes, x0)
        return self._kept[x0]

    def law(self, x0: float, vs: float) -> Law:
        """All shapes of friction."""
        z, w = self.z(x0), self.fine.w
        slow, v = np.abs(w), self.motion.w
        zs = self.fine.coarse(z)
        bell = np.exp(-((w / vs) ** 2))
        dips = [z * bell, z * np.exp(-slow / (1.5 * vs)), z * np.exp(-slow / self.tail(vs))]
        more = [w * bell, z * np.exp(-((w / self.rough) ** 2))]
        d1, d2, d3, bent, smear = self.fine.coarse(np.column_stack([*dips, *more])).T
        grease = np.sign(v) * np.abs(v) ** GREASE
        shapes = (zs, d1, d2, d3, v, grease, bent, self.motion.slope(zs), smear)
        return Law(x0, vs, np.column_stack(shapes))

    def tail(self, vs: float) -> float:
        """Speed of the longest Stribeck curve, rad/s."""
        return min(5 * vs, max(TAIL * self.motion.top, 1.5 * vs))

    def asymmetric(self, x0: float) -> np.ndarray:
        """What an asymmetry of the level adds to the bristle torque, (n,), for a ratio of 1."""
        small = 0.01
        change = self.z(x0, small) - self.z(x0, -small)
        return self.fine.coarse(change / (2 * small))
