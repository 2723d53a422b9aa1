"""Reading a transfer function as exact polynomials; and the border of its stability.

That is the imaginary axis of s, or the unit circle of z as that of v. z = (1 + v)/(1 - v) maps the
inside of the circle onto the left half plane of v, and z = exp(j w dt) onto v = j tan(w dt/2). T as
a function of v has rational coefficients again, so every exact decision for T(s) decides for T(z)
too. The point z = -1, half the sampling rate, is v = infinity.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from numbers import Rational
from types import SimpleNamespace
from typing import Any

import control as ct
import numpy as np

from ..core.display import show_poles
from ..core.errors import InputError
from ..core.validation import shown
from .exact import Poly, add, axis_roots, divide, gcd, hurwitz, mul, poly, scale

EPS = 8 * np.finfo(float).eps  # of the norm of A: rounding that turning the coordinates leaves
ROUNDED = (
    "; a coefficient of L that only rounding keeps from 0 (a pole at s = 0, or none beside the "
    "highest power) was taken for 0"
)
FREQUENT = 2  # least number of frequencies of a measured response
TINY = 1e-9  # a root this near to the axis, relative to its size, is shown as not stable


def roots(p: Poly) -> tuple[complex, ...]:
    """The roots of a polynomial in 1/s, rightmost first, as floats."""
    monic = [to_float(Fraction(c) / p[-1]) for c in reversed(p)]
    if not np.all(np.isfinite(monic)):
        raise InputError("The coefficients of T(s) differ by more than 1e308; rescale time.")
    return tuple(sorted(map(complex, np.roots(monic)), key=lambda s: (-s.real, s.imag)))


def number(value: Any, what: str) -> Fraction:
    """The exact value of a finite real number; InputError for anything else."""
    try:
        if isinstance(value, str):
            raise TypeError
        float(value)  # beyond what a float holds it is none
        if isinstance(value, Rational):  # numpy integers keep a fixed width inside a Fraction
            return Fraction(int(value.numerator), int(value.denominator))
        return Fraction(value if isinstance(value, Decimal) else float(value))
    except (TypeError, ValueError, OverflowError):
        said = f"{what} is {shown(value)}, but a finite real number is needed."
        raise InputError(said) from None


def not_negative(value: Any, name: str, kind: str = "dead time", unit: str = "s") -> Fraction:
    exact = number(0 if value is None else value, name)
    if exact < 0:
        raise InputError(f"{name} is {float(exact):g} {unit}, but a {kind} cannot be negative.")
    return exact


def to_float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def parameter(p: Any, name: str) -> Fraction:
    if not hasattr(p, name):
        what = "the model" if isinstance(p, SimpleNamespace) else shown(p)
        raise InputError(f"{what} has no {name}: give Parameters, a Model or a model file.")
    return number(getattr(p, name), f"parameter {name}")


def read_transfer(T: Any, name: str = "T") -> tuple[Poly, Poly]:
    """Numerator and denominator in lowest terms; InputError, which calls it ``name``, for anything
    else than a continuous system of one input and one output, or a pair (num, den)."""
    if isinstance(T, ct.TransferFunction | ct.StateSpace):
        require_continuous_siso(T, name)
    return lowest_terms(*coefficients(T, name))


def coefficients(T: Any, name: str = "T") -> tuple[Poly, Poly]:
    """Numerator and denominator as they are given, in s or, of a sampled T, in z."""
    if isinstance(T, ct.TransferFunction):
        T = T.num[0][0], T.den[0][0]
    if isinstance(T, ct.StateSpace):
        tops, den = state_space_polynomials(T)
        num = tops[0][0]
    elif isinstance(T, tuple | list) and len(T) == 2:
        num, den = _descending(T[0], "numerator", name), _descending(T[1], "denominator", name)
    else:
        raise InputError(
            f"{name} is {shown(T)}, but a control.TransferFunction, a control.StateSpace "
            "or a pair (num, den) is needed; lg.linearize makes one of a nonlinear system."
        )
    if not den:
        raise InputError(f"The denominator of {name}(s) is zero.")
    return num, den


def lowest_terms(num: Poly, den: Poly) -> tuple[Poly, Poly]:
    common = gcd(num, den)
    return divide(num, common)[0], divide(den, common)[0]


def require_siso(T: Any, name: str) -> None:
    if (T.ninputs, T.noutputs) != (1, 1):
        raise InputError(
            f"{name} has {T.ninputs} inputs and {T.noutputs} outputs, but the check is for one of "
            f"each; pick one channel, such as {name}[0, 0]."
        )


def require_continuous_siso(T: Any, name: str) -> None:
    require_siso(T, name)
    if T.isdtime(strict=True):
        raise InputError(
            f"{name} is discrete-time (dt = {T.dt}), but the check is for continuous time; "
            f"give {name}(s) itself."
        )


def _descending(coefficients: Any, what: str, name: str) -> Poly:
    items = np.atleast_1d(np.asarray(coefficients, dtype=object))
    if items.ndim > 1:
        raise InputError(
            f"The {what} of {name} has {items.ndim} dimensions; give one row of numbers."
        )
    return poly([number(c, f"a coefficient of the {what}") for c in items][::-1])


def state_space_polynomials(T: Any) -> tuple[list[list[Poly]], Poly]:
    """C adj(sI - A) B + D det(sI - A), by output and input, and det(sI - A), by Faddeev and
    LeVerrier."""
    A, B, C, D = (_exact_matrix(M) for M in (T.A, T.B, T.C, T.D))
    eye = _exact_matrix(np.eye(T.nstates))
    M = eye
    nums, den = [_exact_matrix(np.zeros(D.shape))], [Fraction(1)]
    for k in range(1, T.nstates + 1):
        nums.append(C @ M @ B)
        AM = A @ M
        den.append(-sum(np.diagonal(AM), Fraction(0)) / k)
        M = AM + den[-1] * eye
    tops = [
        [poly([n[i, j] + D[i, j] * d for n, d in zip(nums, den, strict=True)][::-1]) for j in row]
        for i, row in enumerate([range(T.ninputs)] * T.noutputs)
    ]
    return tops, poly(den[::-1])


def _exact_matrix(M: Any) -> np.ndarray:
    rows = np.asarray(M, dtype=object)
    values = [number(x, "an entry of the state-space matrices") for x in rows.ravel()]
    return np.array(values, dtype=object).reshape(rows.shape)


def is_measured(T: Any) -> bool:
    return isinstance(T, ct.FrequencyResponseData)


def response(T: Any, name: str = "T") -> tuple[np.ndarray, np.ndarray]:
    """Frequencies w >= 0 in rad/s, ascending, and T(jw) there."""
    require_siso(T, name)
    w, values = np.asarray(T.omega, dtype=float), np.asarray(T.frdata, dtype=complex)[0, 0]
    if len(w) < FREQUENT:
        raise InputError(f"{name} has {len(w)} frequencies; at least {FREQUENT} are needed.")
    if not (np.isfinite(w).all() and np.isfinite(values).all() and (w >= 0).all()):
        raise InputError(f"{name}: the frequencies and values of the response must be finite.")
    order = np.argsort(w, kind="stable")
    if not np.diff(w[order]).all():
        raise InputError(f"{name} has two values at one frequency; give each frequency once.")
    return w[order], values[order]


def span(w: np.ndarray) -> str:
    return f"the {len(w)} measured frequencies from {w[0]:.6g} to {w[-1]:.6g} rad/s"


def cleared(L: Any) -> tuple[Any, str]:
    """L, and a remark where it changed: det(sI - A + BC) - det(sI - A) leaves leading coefficients
    that are eps times those of the denominator, and a pole at s = 0 one of eps times the largest.
    """
    if not isinstance(L, ct.TransferFunction) or (L.ninputs, L.noutputs) != (1, 1) or L.dt:
        return L, ""
    num, den = (np.trim_zeros(np.asarray(p[0][0], dtype=float), "f") for p in (L.num, L.den))
    if not (np.isfinite(num).all() and np.isfinite(den).all() and len(num) <= len(den) > 1):
        return L, ""
    small = np.abs(num) <= EPS * np.abs(den[len(den) - len(num) :])
    lead = 0 if small.all() else int(np.argmin(small))
    constant = EPS * abs(den[-2]) * np.abs(np.roots(den / den[0])).max()
    rounded = den[-2] != 0.0 and 0.0 < abs(den[-1]) <= constant
    if not (lead or rounded):
        return L, ""
    return ct.tf(num[lead:], [*den[:-1], 0.0 if rounded else den[-1]], L.dt), ROUNDED


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
