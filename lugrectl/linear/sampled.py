"""Sampled systems T(z), mapped exactly onto continuous ones.

z = (1 + v)/(1 - v) maps the inside of the unit circle onto the left half plane of v, and
z = exp(j w dt) onto v = j tan(w dt/2). T as a function of v has rational coefficients again, so
every exact decision for T(s) decides for T(z) too. The point z = -1, half the sampling rate, is
v = infinity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

import control as ct
import numpy as np

from .exact import (
    Poly,
    axis_roots,
    distinct_roots,
    hurwitz,
    mul,
    nonnegative,
    odd_roots,
    poly,
    positive,
    positive_roots,
    real_product,
)
from .peaks import least
from .realness import band_edge, positive_real
from .transfer import TINY, coefficients, lowest_terms, require_siso, roots
from .verdict import show_poles

AT_HALF = 1e-13  # a pole this near to z = -1 is moved inside by this


def is_sampled(T: Any) -> bool:
    """Whether T is a linear system of python-control with a sample time."""
    return isinstance(T, ct.TransferFunction | ct.StateSpace) and T.isdtime(strict=True)


def sample_time(T: Any) -> float:
    """T.dt in s; 1 where T is sampled without a stated sample time (dt = True)."""
    return 1.0 if T.dt is True else float(T.dt)


def mapped(a: Poly, degree: int) -> Poly:
    """a(z) (1 - v)^degree as a polynomial in v, of z = (1 + v)/(1 - v)."""
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


def mapped_states(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The model in v of C (zI - A)^-1 B + D, with the same values at z = (1 + v)/(1 - v)."""
    eye = np.eye(len(A))
    if np.abs(np.linalg.eigvals(A) + 1).min(initial=1.0) < AT_HALF:  # v is infinite there
        A = A * (1 - AT_HALF)
    inverse, root = np.linalg.inv(A + eye), math.sqrt(2)
    return (
        inverse @ (A - eye),
        root * inverse @ B,
        root * C @ inverse,
        D - C @ inverse @ B,
    )


def on_circle(v: float) -> complex:
    """z of jv; -1 of infinity."""
    return -1.0 + 0j if math.isinf(v) else (1 + 1j * v) / (1 - 1j * v)


def inside(a: Poly) -> bool:
    """Whether every root of a(z) lies inside the unit circle."""
    m = mapped(a, len(a) - 1)
    return len(m) == len(a) and hurwitz(m)


def circle_roots(a: Poly) -> tuple[complex, ...]:
    """The roots of a(z), the largest first; those near z = 1 come apart as they do in v."""
    m = mapped(a, len(a) - 1)
    found = [(1 + v) / (1 - v) for v in roots(m)] + [-1 + 0j] * (len(a) - len(m))
    return tuple(sorted(found, key=lambda z: (-abs(z), z.imag)))


@dataclass(frozen=True)
class Sampled:
    """T(z) = num/den in lowest terms, ascending powers of z; ``cancelled``: what was removed."""

    num: Poly
    den: Poly
    cancelled: Poly
    dt: float

    @classmethod
    def of(cls, T: Any, name: str = "T") -> Sampled:
        """Raises InputError for several channels or values that are not finite."""
        require_siso(T, name)
        return cls(*lowest_terms(*coefficients(T, name)), sample_time(T))

    @property
    def degree(self) -> int:
        return max(len(self.num), len(self.den)) - 1

    @property
    def in_v(self) -> tuple[Poly, Poly]:
        """Numerator and denominator in v, in lowest terms as T(z) is."""
        return mapped(self.num, self.degree), mapped(self.den, self.degree)

    @property
    def nyquist(self) -> float:
        """Half the sampling rate in rad/s."""
        return math.pi / self.dt

    @property
    def stable(self) -> bool:
        return inside(self.den)

    @property
    def poles(self) -> tuple[complex, ...]:
        """Roots of ``den`` in z, the largest first (floats: for display, not for decisions)."""
        return circle_roots(self.den)

    @property
    def hidden(self) -> str:
        """A remark on a mode that is not stable and cancelled from T(z); empty without one."""
        if inside(self.cancelled):
            return ""
        modes = show_poles([z for z in circle_roots(self.cancelled) if abs(z) >= 1 - TINY])
        return (
            f"a mode of the system that is not stable (z = {modes}) was cancelled from T(z): "
            "the system itself is not stable"
        )

    @property
    def hidden_outside(self) -> bool:
        """Whether a mode outside the unit circle cancelled."""
        return axis_roots(mapped(self.cancelled, len(self.cancelled) - 1))[1]

    def frequency(self, v: float) -> float:
        """w in rad/s of v = j tan(w dt/2)."""
        return 2.0 * math.atan(v) / self.dt

    def scaled(self, radius: Fraction) -> Sampled:
        """T(radius z)."""
        num, den = (tuple(c * radius**i for i, c in enumerate(a)) for a in (self.num, self.den))
        return Sampled(num, den, self.cancelled, self.dt)


def classify(T: Sampled) -> str:
    """ "SPR", "PR" or "not PR"; the circle is closed, so there is nothing between SPR and PR."""
    num, den = T.in_v
    if not positive_real(num, den):
        return "not PR"
    real = real_product(num, den)
    strict = T.stable and positive(real) and len(real) == T.degree + 1
    return "SPR" if strict else "PR"


def margin(T: Sampled) -> float:
    """Largest eps in 1/s with T(exp(-eps dt) z) positive real, of an SPR T, by bisection."""
    if not T.degree:
        return math.inf

    def holds(less: Fraction) -> bool:
        return positive_real(*T.scaled(1 - less).in_v)

    low, high = Fraction(1, 2), Fraction(1)
    while not holds(low):
        low, high = low / 2, low
    while high - low > low / 2**50:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return -math.log1p(-float(low)) / T.dt


def edge(T: Sampled) -> float:
    """End of the band (0+, edge) with Re T > 0 in rad/s; inf if it reaches half the rate."""
    num, den = T.in_v
    found = band_edge(num, den)
    if math.isfinite(found):
        return T.frequency(found)
    real, square = real_product(num, den), real_product(den, den)
    return T.nyquist if len(real) < len(square) else found


def realness(T: Sampled) -> tuple[str, float, float, str]:
    """Classification, margin in 1/s, band edge in rad/s and reason."""
    kind, end = classify(T), edge(T)
    eps = margin(T) if kind == "SPR" else 0.0
    reason = {"SPR": _why_spr, "PR": _why_pr, "not PR": _why_not}[kind](T)
    return kind, eps, end, "; ".join(filter(None, [reason, T.hidden]))


def _why_spr(T: Sampled) -> str:
    if not T.degree:
        return "no poles and T > 0"
    value, v = least(*T.in_v)
    return (
        f"poles inside the unit circle (the largest |z| = {abs(T.poles[0]):.6g}) and "
        f"Re T(exp(jw dt)) > 0 at every w, the least {value:.6g} at w = {T.frequency(v):.6g} rad/s"
    )


def _why_pr(T: Sampled) -> str:
    num, den = T.in_v
    real = real_product(num, den)
    if not real:
        return "T is zero" if not num else "T is lossless, Re T = 0 at every w"
    if not T.stable:
        at = [T.frequency(v) for v in axis_roots(den)[0]] + [T.nyquist] * (len(den) <= T.degree)
        where = ", ".join(f"{w:.6g}" for w in at)
        return f"simple poles with positive residues on the unit circle at w = {where} rad/s"
    zeros = [0.0] * (not real[0]) + [T.frequency(v) for v in _roots(distinct_roots(real))]
    zeros += [T.nyquist] * (len(real) <= T.degree)
    where = ", ".join(f"{w:.6g}" for w in zeros)
    return f"Re T(exp(jw dt)) >= 0, but it is 0 at w = {where} rad/s"


def _why_not(T: Sampled) -> str:
    late = len(T.den) - len(T.num)
    if T.num and late < 0:
        return f"T(z) is improper: its output would need the input {_samples(-late)} ahead"
    num, den = T.in_v
    on, outside = axis_roots(den)
    if outside:
        shown = show_poles([z for z in T.poles if abs(z) > 1])
        return f"T has poles outside the unit circle (z = {shown})"
    real, causes = real_product(num, den), []
    if not nonnegative(real):
        causes.append(f"Re T(exp(jw dt)) < 0 {_bands(T, real)}")
    if late > 0:
        causes.append(
            f"T has a delay of {_samples(late)}: without a direct part, T(z) -> 0 as z grows, no "
            "T(z) is positive real"
        )
    if not causes:
        at = [T.frequency(v) for v in on] + [T.nyquist] * (len(den) <= T.degree)
        where = ", ".join(f"{w:.6g}" for w in at)
        causes.append(
            "a pole on the unit circle is repeated or its residue is not positive "
            f"(poles at w = {where} rad/s)"
        )
    return "; ".join(causes)


def _samples(many: int) -> str:
    return f"{many} sample{'s' * (many > 1)}"


def _roots(a: Poly) -> list[float]:
    return [math.sqrt(x) for x in positive_roots(a)]


def _bands(T: Sampled, real: Poly) -> str:
    """The frequency bands with Re T < 0, in words."""
    ends = [T.frequency(v) for v in _roots(odd_roots(real))]
    if next(c for c in real if c) < 0:
        ends.insert(0, 0.0)
    pairs = list(pairwise([*ends, T.nyquist]))[0::2]
    return " and ".join(f"for {a:.6g} < w < {b:.6g} rad/s" for a, b in pairs)
