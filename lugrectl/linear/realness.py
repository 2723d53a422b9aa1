"""Positive realness of num/den in lowest terms, decided on exact rational numbers."""

from __future__ import annotations

import math
from fractions import Fraction

from .exact import (
    Poly,
    add,
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
from .transfer import to_float


def positive_real(num: Poly, den: Poly) -> bool:
    """Whether num/den, in lowest terms, is positive real."""
    return nonnegative(real_product(num, den)) and hurwitz(add(num, den))


def classify(num: Poly, den: Poly) -> str:
    """ "SPR", "WSPR", "PR" or "not PR", of num/den in lowest terms."""
    if not positive_real(num, den):
        return "not PR"
    real = real_product(num, den)
    if not (positive(real) and hurwitz(den)):
        return "PR"
    # Of full degree, Re T (times w^2 for relative degree 1) has a limit above zero.
    return "SPR" if len(real) == min(len(num), len(den)) else "WSPR"


def margin(num: Poly, den: Poly) -> float:
    """Largest eps with T(s - eps) PR, of an SPR T, by bisection of the exact decision."""
    # Poles and zeros must stay left of the axis; the nearest one is not farther than their mean.
    means = [Fraction(p[-2]) / p[-1] / (len(p) - 1) for p in (num, den) if len(p) > 1]
    if not means:
        return math.inf
    nearest = min(means)
    if positive_real(shift(num, nearest), shift(den, nearest)):
        return to_float(nearest)
    bits = nearest.numerator.bit_length() - nearest.denominator.bit_length()
    low = Fraction(2) ** bits
    high = 2 * low
    while not positive_real(shift(num, low), shift(den, low)):
        low, high = low / 2, low
    while high - low > low / 2**50:
        eps = (low + high) / 2
        if positive_real(shift(num, eps), shift(den, eps)):
            low = eps
        else:
            high = eps
    return to_float(low)


def band_edge(num: Poly, den: Poly) -> float:
    """End of the band (0+, edge) with Re T(jw) > 0, in rad/s."""
    real, square = real_product(num, den), real_product(den, den)
    if not real:
        return 0.0
    # In lowest terms a pole on the axis at which Re T is finite does not end the band.
    common = gcd(real, square)
    real, square = divide(real, common)[0], divide(square, common)[0]
    at_zero = next(c for c in real if c) * next(c for c in square if c)
    if at_zero < 0:
        return 0.0
    ends = positive_roots(distinct_roots(real)) + positive_roots(odd_roots(square))
    return math.sqrt(min(ends, default=math.inf))
