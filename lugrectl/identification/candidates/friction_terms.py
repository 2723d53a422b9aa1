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

from ...blocks.measured_bristle import along, strokes
from ..regression.numbers import TAIL
from ..regression.smooth_motion import Fine, Motion

BENDS = (0.5, 1.0, 2.0, 4.0, 8.0)  # of the declared presliding distance
SPEEDS = (0.5, 0.8, 1.2, 2.0, 4.0)  # of the declared Stribeck speed
FORCES = ("Fc", "dip", "dip 1.5", "dip 5")  # the part that scales with the level of friction
VISCOUS = ("Fv", "grease", "slow Fv")
SMEAR = ("sigma1", "smear")
NAMES = (*FORCES, *VISCOUS, *SMEAR)
LAW = ("Fc", "dip", "Fv", "sigma1")  # what the declared law has
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
            return along(*self._strokes, x0, asymmetry)
        if x0 not in self._kept:
            self._kept[x0] = along(*self._strokes, x0)
        return self._kept[x0]

    def law(self, x0: float, vs: float) -> Law:
        """All shapes of friction."""
        z, w = self.z(x0), self.fine.w
        slow, v = np.abs(w), self.motion.w
        zs = self.fine.coarse(z)
        curves = self.curves(slow, vs)
        dips = [z * curve for curve in curves]
        more = [w * curves[0], z * np.exp(-((w / self.rough) ** 2))]
        d1, d2, d3, bent, smear = self.fine.coarse(np.column_stack([*dips, *more])).T
        grease = np.sign(v) * np.abs(v) ** GREASE
        shapes = (zs, d1, d2, d3, v, grease, bent, self.motion.slope(zs), smear)
        return Law(x0, vs, np.column_stack(shapes))

    def curves(self, slow: np.ndarray, vs: float) -> tuple[np.ndarray, ...]:
        """The three Stribeck curves over |w|, from 1 at rest to 0: of "dip" to "dip 5"."""
        tail = min(5 * vs, max(TAIL * self.motion.top, 1.5 * vs))
        return np.exp(-((slow / vs) ** 2)), np.exp(-slow / (1.5 * vs)), np.exp(-slow / tail)

    def asymmetric(self, x0: float) -> np.ndarray:
        """What an asymmetry of the level adds to the bristle torque, (n,), for a ratio of 1."""
        small = 0.01
        change = self.z(x0, small) - self.z(x0, -small)
        return self.fine.coarse(change / (2 * small))
