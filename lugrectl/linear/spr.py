"""Strict positive realness, decided on exact rational numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from .exact import (
    Poly,
    add,
    axis_roots,
    distinct_roots,
    divide,
    gcd,
    hurwitz,
    nonnegative,
    odd_roots,
    positive,
    positive_roots,
    real_product,
    shift,
)
from .transfer import Transfer, read_transfer, to_float
from .verdict import Verdict, show_poles

NEAR_ZERO = 1e-12


@dataclass(frozen=True)
class SprVerdict(Verdict):
    """Truthy iff T(s) is strictly positive real.

    ``classification``: "SPR", "WSPR" (Re T(jw) > 0 at every finite w, but not T(s - eps)
    positive real for any eps > 0), "PR", "not PR". ``margin``: the largest eps in 1/s for which
    T(s - eps) is positive real; inf for a positive constant, 0 unless SPR. ``band_edge``: end of
    the band (0+, band_edge) with Re T(jw) > 0 in rad/s; inf if nothing ends it, 0 if Re T is
    not positive just above w = 0.
    """

    classification: str
    margin: float
    band_edge: float
    reason: str

    def __bool__(self) -> bool:
        return self.classification == "SPR"


def spr_check(T: Any) -> SprVerdict:
    """Whether T(s) is strictly positive real (SPR), weakly so, positive real (PR) or not.

    With T = n/d in lowest terms, x = w^2 and P(x) = Re(n(jw) conj d(jw)), so that
    Re T(jw) = P(x)/|d(jw)|^2:

    - PR iff P >= 0 on x >= 0 and n + d is Hurwitz, that is, (T - 1)/(T + 1) is bounded real;
      this covers simple imaginary-axis poles with positive residues.
    - WSPR iff also P > 0 on x >= 0 and d is Hurwitz.
    - SPR iff also Re T(jw) does not vanish as w grows, or for relative degree 1
      w^2 Re T(jw) does not (Ioannou and Tao, IEEE TAC 32(1), 1987). For relative degree -1 the
      limit of Re T is required to be positive too, as 1/T must be SPR along with T:
      s + 1/(s + 1) is WSPR only.

    P is decided by Sturm chains and n + d by Routh, both on rational numbers, never on a
    frequency grid. The given coefficients are taken as exact, so equality such as
    sigma1 Kd = sigma0 J holds only if it holds for the floats; the reason says when a
    coefficient of P is within 1e-12 of zero, relative to its terms. Give the pair (num, den) as
    fractions.Fraction to decide on decimals. T = 0 counts as PR.

    T : continuous SISO control.TransferFunction or StateSpace, or a pair (num, den) in
        descending powers of s. Raises InputError if it is none of these.
    """
    transfer = read_transfer(T)
    num, den, _ = transfer
    kind = _classify(num, den)
    margin = _margin(num, den) if kind == "SPR" else 0.0
    edge = _band_edge(num, den)
    reason = _REASONS[kind](transfer, edge) + _rounding(num, den)
    return SprVerdict(kind, margin, edge, f"{kind}: {reason}.")


def _positive_real(num: Poly, den: Poly) -> bool:
    return nonnegative(real_product(num, den)) and hurwitz(add(num, den))


def _classify(num: Poly, den: Poly) -> str:
    if not _positive_real(num, den):
        return "not PR"
    real = real_product(num, den)
    if not (positive(real) and hurwitz(den)):
        return "PR"
    # Of full degree, Re T (times w^2 for relative degree 1) has a limit above zero.
    return "SPR" if len(real) == min(len(num), len(den)) else "WSPR"


def _margin(num: Poly, den: Poly) -> float:
    """Largest eps with T(s - eps) PR, of an SPR T, by bisection of the exact decision."""
    # Poles and zeros must stay left of the axis, and the nearest is not beyond their mean.
    means = [Fraction(p[-2]) / p[-1] / (len(p) - 1) for p in (num, den) if len(p) > 1]
    if not means:
        return math.inf
    nearest = min(means)
    if _positive_real(shift(num, nearest), shift(den, nearest)):
        return to_float(nearest)
    bits = nearest.numerator.bit_length() - nearest.denominator.bit_length()
    low = Fraction(2) ** bits
    high = 2 * low
    while not _positive_real(shift(num, low), shift(den, low)):
        low, high = low / 2, low
    while high - low > low / 2**50:
        eps = (low + high) / 2
        if _positive_real(shift(num, eps), shift(den, eps)):
            low = eps
        else:
            high = eps
    return to_float(low)


def _band_edge(num: Poly, den: Poly) -> float:
    real, square = real_product(num, den), real_product(den, den)
    if not real:
        return 0.0
    # In lowest terms an axis pole that leaves Re T finite does not end the band.
    common = gcd(real, square)
    real, square = divide(real, common)[0], divide(square, common)[0]
    at_zero = next(c for c in real if c) * next(c for c in square if c)
    if at_zero < 0:
        return 0.0
    ends = positive_roots(distinct_roots(real)) + positive_roots(odd_roots(square))
    return math.sqrt(min(ends, default=math.inf))


def _negative_bands(real: Poly) -> str:
    """Where a P that is somewhere negative is so, in words."""
    ends = [math.sqrt(x) for x in positive_roots(odd_roots(real))]
    if next(c for c in real if c) < 0:
        ends.insert(0, 0.0)
    return " and ".join(_band(a, b) for a, b in list(pairwise([*ends, math.inf]))[0::2])


def _band(low: float, high: float) -> str:
    if math.isfinite(high):
        return f"for {low:.6g} < w < {high:.6g} rad/s" if low else f"for w < {high:.6g} rad/s"
    return f"for w > {low:.6g} rad/s" if low else "at every w"


def _limit(num: Poly, den: Poly) -> str:
    """The high-frequency limit of Re T in words."""
    real, full = real_product(num, den), min(len(num), len(den))
    value = Fraction(real[full - 1]) / den[-1] ** 2 if len(real) >= full else 0
    name = "w^2 Re T(jw)" if len(den) > len(num) else "Re T(jw)"
    return f"{name} tends to {float(value):.6g} as w grows"


def _why_spr(transfer: Transfer, edge: float) -> str:
    if not transfer.poles:
        return f"no poles, Re T(jw) > 0 at every w and {_limit(*transfer[:2])}"
    slowest = transfer.poles[0].real
    return (
        f"poles left of the axis (the rightmost at Re s = {slowest:.6g} 1/s), Re T(jw) > 0 "
        f"at every w and {_limit(*transfer[:2])}"
    )


def _why_wspr(transfer: Transfer, edge: float) -> str:
    return f"Re T(jw) > 0 at every finite w, but {_limit(*transfer[:2])}"


def _why_pr(transfer: Transfer, edge: float) -> str:
    num, den, _ = transfer
    real = real_product(num, den)
    if not real:
        return "T is zero" if not num else "T is lossless, Re T(jw) = 0 at every w"
    if not hurwitz(den):
        axis = ", ".join(f"{w:.6g}" for w in axis_roots(den)[0])
        return f"simple poles with positive residues on the imaginary axis at w = {axis} rad/s"
    if not real[0]:
        return "Re T(jw) >= 0, but T has a zero at s = 0"
    return f"Re T(jw) >= 0, but it touches 0 at w = {edge:.6g} rad/s"


def _why_not(transfer: Transfer, edge: float) -> str:
    num, den, _ = transfer
    axis, right = axis_roots(den)
    if right:
        return f"T has poles right of the imaginary axis (poles {show_poles(transfer.poles)} 1/s)"
    degree, real = len(den) - len(num), real_product(num, den)
    causes = []
    if not nonnegative(real):
        causes.append(f"Re T(jw) < 0 {_negative_bands(real)}")
    if abs(degree) > 1:
        causes.append(f"the relative degree is {degree}, which must be -1, 0 or 1")
    elif causes:
        causes.append(_limit(num, den))
    else:
        where = [f"w = {w:.6g} rad/s" for w in axis] + ["infinity"] * (degree == -1)
        causes.append(
            "a pole on the imaginary axis is repeated or its residue is not positive "
            f"(poles at {', '.join(where)})"
        )
    return "; ".join(causes)


_REASONS = {"SPR": _why_spr, "WSPR": _why_wspr, "PR": _why_pr, "not PR": _why_not}


def _rounding(num: Poly, den: Poly) -> str:
    """A remark when a coefficient of P is nothing but the rounding of its terms."""
    real = real_product(num, den)
    terms = real_product(
        *(tuple(abs(c) * (-1) ** (i // 2) for i, c in enumerate(p)) for p in (num, den))
    )
    near = [float(abs(Fraction(c)) / t) for c, t in zip(real, terms, strict=False) if c]
    if not near or min(near) > NEAR_ZERO:
        return ""
    return (
        f"; a coefficient of P differs from 0 by only {min(near):.1e} of its terms, so the "
        "rounding of the inputs decides"
    )
