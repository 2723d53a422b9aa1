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
from fractions import Fraction
from typing import Any

import control as ct
import numpy as np

from ..core.display import show_poles
from .exact import Poly, axis_roots, hurwitz, mul, poly
from .transfer import TINY, roots

AT_HALF = 1e-13  # a pole this near to z = -1 is moved inside by this
Matrices = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


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

    def mapped_states(self, A: Any, B: Any, C: Any, D: Any) -> Matrices:
        """Return the continuous model with the same values on the border."""
        return A, B, C, D

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
        up: list[Poly] = [(1,)]
        down: list[Poly] = [(1,)]
        for _ in range(degree):
            up.append(mul(up[-1], (1, 1)))
            down.append(mul(down[-1], (1, -1)))
        out: list[Fraction | int] = [0] * (degree + 1)
        for k, c in enumerate(a):
            for i, term in enumerate(mul(up[k], down[degree - k])):
                out[i] += c * term
        return poly(out)

    def mapped_states(self, A: Any, B: Any, C: Any, D: Any) -> Matrices:
        eye = np.eye(len(A))
        if np.abs(np.linalg.eigvals(A) + 1).min(initial=1.0) < AT_HALF:  # v is infinite there
            A = A * (1 - AT_HALF)
        inverse, root = np.linalg.inv(A + eye), math.sqrt(2)
        return inverse @ (A - eye), root * inverse @ B, root * C @ inverse, D - C @ inverse @ B

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
