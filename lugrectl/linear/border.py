"""The border of stability: the imaginary axis of s, or the unit circle of z as that of v.

z = (1 + v)/(1 - v) maps the inside of the unit circle onto the left half plane of v, and
z = exp(j w dt) onto v = j tan(w dt/2). T as a function of v has rational coefficients again, so
every exact decision for T(s) decides for T(z) too. The point z = -1, half the sampling rate, is
v = infinity.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..core.display import show_poles
from .exact import Poly, add, axis_roots, hurwitz, mul, scale
from .transfer import TINY, roots


@dataclass(frozen=True)
class Axis:
    """The imaginary axis of s; frequencies on it are in rad/s."""

    dt: float | None = None
    variable, argument, real = "s", "jw", "Re T(jw)"
    outside, on = "right of the imaginary axis", "on the imaginary axis"
    least, poles, unit = "rightmost", "poles", " 1/s"

    def frequency(self, v: float) -> float:
        """Return w in rad/s at the place jv."""
        return v

    def point(self, v: float, shift: float = 0.0) -> complex:
        """Return s or z at the place jv, of T(s - shift) or T(exp(-shift) z)."""
        return 1j * v - shift

    def beyond(self, poles: np.ndarray) -> np.ndarray:
        """Return how far outside the border poles are."""
        return np.real(poles)

    def order(self, poles: np.ndarray) -> np.ndarray:
        return poles[np.lexsort((np.imag(poles), -np.asarray(self.beyond(poles))))]

    def rates(self, poles: np.ndarray) -> np.ndarray:
        return poles

    def marks(self, poles: np.ndarray) -> np.ndarray:
        """Return poles in the variable whose imaginary axis the frequencies lie on."""
        return poles

    def place(self, w: Any) -> Any:
        """Return the v of frequencies in rad/s."""
        return w

    def show(self, poles: Iterable[complex]) -> str:
        return f"{self.poles} {show_poles([*map(complex, poles)])}{self.unit}"

    def modes(self, poles: Iterable[complex]) -> str:
        return f"{self.variable} = {show_poles([*map(complex, poles)])}{self.unit}"

    def least_stable(self, pole: complex) -> str:
        return f"poles left of the axis (the rightmost at Re s = {pole.real:.6g} 1/s)"

    def mapped(self, a: Poly, degree: int) -> Poly:
        """Return a of s or z as a polynomial in s or, times (1 - v)^degree, in v."""
        return a

    def stable(self, a: Poly) -> bool:
        return hurwitz(a)

    def has_outside(self, a: Poly) -> bool:
        return not self.stable(a) and axis_roots(self.mapped(a, len(a) - 1))[1]

    def roots(self, a: Poly) -> tuple[complex, ...]:
        """Return the roots of a, the least stable first (floats: not for decisions)."""
        return roots(a)


@dataclass(frozen=True)
class Circle(Axis):
    """The unit circle of z; ``dt`` in s, 1 where it is not stated."""

    dt: float = 1.0
    variable, argument, real = "z", "exp(jw dt)", "Re T(exp(jw dt))"
    outside, on = "outside the unit circle", "on the unit circle"
    least, poles, unit = "largest", "z =", ""

    def frequency(self, v: float) -> float:
        return 2.0 * math.atan(v) / self.dt

    def point(self, v: float, shift: float = 0.0) -> complex:
        z = -1.0 + 0j if math.isinf(v) else (1 + 1j * v) / (1 - 1j * v)
        return math.exp(-shift) * z

    def beyond(self, poles: np.ndarray) -> np.ndarray:
        return np.abs(poles) - 1

    def rates(self, poles: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return np.log(np.asarray(poles, dtype=complex)) / self.dt

    def marks(self, poles: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return (poles - 1) / (poles + 1)

    def place(self, w: Any) -> Any:
        return np.tan(0.5 * self.dt * w)

    def least_stable(self, pole: complex) -> str:
        return f"poles inside the unit circle (the largest |z| = {abs(pole):.6g})"

    def mapped(self, a: Poly, degree: int) -> Poly:
        total: Poly = ()
        down: Poly = (1,)  # powers of 1 - v, beside Horner's scheme
        for c in reversed((*a, *[0] * (degree + 1 - len(a)))):
            total = add(mul(total, (1, 1)), scale(down, c))
            down = mul(down, (1, -1))
        return total

    def stable(self, a: Poly) -> bool:
        m = self.mapped(a, len(a) - 1)
        return len(m) == len(a) and hurwitz(m)

    def roots(self, a: Poly) -> tuple[complex, ...]:
        """Those near z = 1 come apart as they do in v."""
        m = self.mapped(a, len(a) - 1)
        found = [(1 + v) / (1 - v) for v in roots(m)] + [-1 + 0j] * (len(a) - len(m))
        return tuple(sorted(found, key=lambda z: (-abs(z), z.imag)))


def is_sampled(T: Any) -> bool:
    return isinstance(T, ct.TransferFunction | ct.StateSpace) and T.isdtime(strict=True)


def border_of(T: Any) -> Axis:
    """Return the border of a system; without a stated sample time (dt = True) per sample."""
    if not is_sampled(T):
        return Axis()
    return Circle(1.0 if T.dt is True else float(T.dt))


def says_hidden(border: Axis, cancelled: Poly) -> str:
    """Return a remark on modes that cancelled from T and are not stable; "" without one."""
    if border.stable(cancelled):
        return ""
    found = np.array(border.roots(cancelled))
    modes = border.modes(found[border.beyond(found) >= -TINY * np.abs(found)])
    return (
        f"a mode of the system that is not stable ({modes}) was cancelled from "
        f"T({border.variable}): the system itself is not stable"
    )
