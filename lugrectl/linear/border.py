"""The border of stability: the imaginary axis of s, or the unit circle of z as that of v.

z = (1 + v)/(1 - v) maps the inside of the unit circle onto the left half plane of v, and
z = exp(j w dt) onto v = j tan(w dt/2). T as a function of v has rational coefficients again, so
every exact decision for T(s) decides for T(z) too. The point z = -1, half the sampling rate, is
v = infinity.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
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

    def points(self, w: np.ndarray, less: float = 0.0) -> np.ndarray:
        """Return s or z at frequencies in rad/s, of T(s - less) or T((1 - less) z)."""
        return 1j * w - less if self.dt is None else (1.0 - less) * np.exp(1j * w * self.dt)

    def rate(self, less: float) -> float:
        """Return the eps in 1/s of T(s - less), or T((1 - less) z) = T(exp(-eps dt) z)."""
        return less if self.dt is None else -math.log1p(-less) / self.dt

    def beyond(self, poles: np.ndarray) -> np.ndarray:
        """Return how far outside the border poles are."""
        return np.real(poles) if self.dt is None else np.abs(poles) - 1

    def ordered(self, poles: Any) -> np.ndarray:
        found = np.asarray(poles, dtype=complex)
        return found[np.lexsort((np.imag(found), -self.beyond(found)))]

    def rates(self, poles: np.ndarray) -> np.ndarray:
        if self.dt is None:
            return poles
        with np.errstate(all="ignore"):
            return np.log(np.asarray(poles, dtype=complex)) / self.dt

    def show(self, poles: Iterable[complex], name: str = "poles ") -> str:
        shown = show_poles([*map(complex, poles)])
        return f"{name}{shown} 1/s" if self.dt is None else f"z = {shown}"

    def least_stable(self, poles: Sequence[complex]) -> str:
        if not len(poles):
            return f"no poles {self.outside}"
        if self.dt is None:
            at = f"{complex(poles[0]).real:.6g}"
            return f"poles left of the axis (the rightmost at Re s = {at} 1/s)"
        return f"poles inside the unit circle (the largest |z| = {abs(poles[0]):.6g})"

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

    def unstable(self, a: Poly) -> tuple[int, list[float]]:
        """Return how many roots of a are outside, and the frequencies of those on the border."""
        if self.stable(a):
            return 0, []
        m = self.mapped(a, len(a) - 1)
        on, right = axis_roots(m)
        many = max(1, sum(v.real > TINY * abs(v) for v in roots(m))) if right else 0
        return many, [self.frequency(v) for v in [*on, *[math.inf] * (len(m) < len(a))]]

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
    variable, argument = "z", "exp(jw dt)"
    outside, on = "outside the unit circle", "on the unit circle"


def is_sampled(T: Any) -> bool:
    return isinstance(T, ct.TransferFunction | ct.StateSpace) and T.isdtime(strict=True)


def border_of(T: Any) -> Border:
    """Return the border of a system; without a stated sample time (dt = True) per sample."""
    return Circle(1.0 if T.dt is True else float(T.dt)) if is_sampled(T) else Border()
