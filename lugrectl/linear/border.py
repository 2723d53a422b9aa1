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
class Border:
    """The imaginary axis of s, or with ``dt`` in s the unit circle of z; frequencies on it are in
    rad/s."""

    dt: float | None = None
    variable, argument = "s", "jw"
    outside, on = "right of the imaginary axis", "on the imaginary axis"

    @property
    def real(self) -> str:
        return f"Re T({self.argument})"

    def frequency(self, v: float) -> float:
        """Return w in rad/s at the place jv."""
        return v if self.dt is None else 2.0 * math.atan(v) / self.dt

    def place(self, w: Any) -> Any:
        """Return the v of frequencies in rad/s."""
        return w if self.dt is None else np.tan(0.5 * self.dt * w)

    def point(self, v: float, less: float = 0.0) -> complex:
        """Return s or z at the place jv, of T(s - less) or T((1 - less) z)."""
        if self.dt is None:
            return 1j * v - less
        return (1.0 - less) * (-1.0 + 0j if math.isinf(v) else (1 + 1j * v) / (1 - 1j * v))

    def rate(self, less: float) -> float:
        """Return the eps in 1/s of T(s - less), or T((1 - less) z) = T(exp(-eps dt) z)."""
        return less if self.dt is None else -math.log1p(-less) / self.dt

    def beyond(self, poles: np.ndarray) -> np.ndarray:
        """Return how far outside the border poles are."""
        return np.real(poles) if self.dt is None else np.abs(poles) - 1

    def ordered(self, poles: Any) -> np.ndarray:
        """Return poles, the least stable first."""
        found = np.asarray(poles, dtype=complex)
        return found[np.lexsort((np.imag(found), -self.beyond(found)))]

    def rates(self, poles: np.ndarray) -> np.ndarray:
        if self.dt is None:
            return poles
        with np.errstate(all="ignore"):
            return np.log(np.asarray(poles, dtype=complex)) / self.dt

    def marks(self, poles: np.ndarray) -> np.ndarray:
        """Return poles in the variable whose imaginary axis the frequencies lie on."""
        if self.dt is None:
            return poles
        with np.errstate(all="ignore"):
            return (poles - 1) / (poles + 1)

    def show(self, poles: Iterable[complex], name: str = "poles ") -> str:
        shown = show_poles([*map(complex, poles)])
        return f"{name}{shown} 1/s" if self.dt is None else f"z = {shown}"

    def least_stable(self, pole: complex) -> str:
        if self.dt is None:
            return f"poles left of the axis (the rightmost at Re s = {pole.real:.6g} 1/s)"
        return f"poles inside the unit circle (the largest |z| = {abs(pole):.6g})"

    def mapped(self, a: Poly, degree: int) -> Poly:
        """Return a of s or z as a polynomial in s or, times (1 - v)^degree, in v."""
        if self.dt is None:
            return a
        total: Poly = ()
        down: Poly = (1,)  # powers of 1 - v, beside Horner's scheme
        for c in reversed((*a, *[0] * (degree + 1 - len(a)))):
            total = add(mul(total, (1, 1)), scale(down, c))
            down = mul(down, (1, -1))
        return total

    def stable(self, a: Poly) -> bool:
        m = self.mapped(a, len(a) - 1)
        return len(m) == len(a) and hurwitz(m)

    def has_outside(self, a: Poly) -> bool:
        return not self.stable(a) and axis_roots(self.mapped(a, len(a) - 1))[1]

    def roots(self, a: Poly) -> tuple[complex, ...]:
        """Return the roots of a, the least stable first (floats: not for decisions); those near
        z = 1 come apart as they do in v."""
        m = self.mapped(a, len(a) - 1)
        found = roots(m)
        if self.dt is not None:
            found = [(1 + v) / (1 - v) for v in found] + [-1 + 0j] * (len(a) - len(m))
        return tuple(map(complex, self.ordered(found)))

    def hidden(self, cancelled: Poly) -> str:
        """Return a remark on modes that cancelled from T and are not stable; "" without one."""
        if self.stable(cancelled):
            return ""
        found = np.array(self.roots(cancelled))
        modes = self.show(found[self.beyond(found) >= -TINY * np.abs(found)], "s = ")
        return (
            f"a mode of the system that is not stable ({modes}) was cancelled from "
            f"T({self.variable}): the system itself is not stable"
        )


class Circle(Border):
    """The unit circle in words."""

    variable, argument = "z", "exp(jw dt)"
    outside, on = "outside the unit circle", "on the unit circle"


def is_sampled(T: Any) -> bool:
    return isinstance(T, ct.TransferFunction | ct.StateSpace) and T.isdtime(strict=True)


def border_of(T: Any) -> Border:
    """Return the border of a system; without a stated sample time (dt = True) per sample."""
    return Circle(1.0 if T.dt is True else float(T.dt)) if is_sampled(T) else Border()
