"""Where |T(jw)| is largest and Re T(jw) least, isolated on exact rational numbers."""

from __future__ import annotations

import math
from fractions import Fraction

from .exact import Poly, add, at, derivative, mul, odd_roots, positive_roots, real_product, scale
from .transfer import to_float


def largest(num: Poly, den: Poly) -> tuple[float, float]:
    """sup |T(jw)| of a stable, proper num/den, and the w at which it is; inf: as w grows."""
    square, w = _extreme(real_product(num, num), real_product(den, den), 1)
    return math.sqrt(to_float(square)), w


def least(num: Poly, den: Poly) -> tuple[float, float]:
    """inf Re T(jw) of a stable, proper num/den, and the w at which it is; inf: as w grows."""
    value, w = _extreme(real_product(num, den), real_product(den, den), -1)
    return to_float(value), w


def _extreme(N: Poly, D: Poly, sign: int) -> tuple[Fraction, float]:
    """The largest (sign 1) or least (-1) N(x)/D(x) on x = w^2 >= 0, and w.

    N/D has it at x = 0, as x grows, or where N'D - N D' changes its sign.
    """
    slope = add(mul(derivative(N), D), scale(mul(N, derivative(D)), -1))
    places = [Fraction(0), *map(Fraction, positive_roots(odd_roots(slope)))] if slope else [0]
    size = {math.sqrt(to_float(Fraction(x))): Fraction(at(N, x)) / at(D, x) for x in places}
    end = Fraction(N[-1]) / D[-1] if len(N) == len(D) else Fraction(0)
    size.setdefault(math.inf, end)
    w = max(size, key=lambda place: sign * size[place])
    return size[w], w
