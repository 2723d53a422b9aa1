"""Where |T(jw)| is largest and Re T(jw) least: exactly of rational numbers, else between bounds."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from ..core.errors import InputError
from .axis import reach, signs
from .delayed import DelayedTransfer
from .exact import Poly, add, at, derivative, mul, odd_roots, positive_roots, real_product, scale
from .transfer import to_float

RISE = 1e-7  # of the gain: nothing is above it by more
SAME = 1e-12
LEVELS = 60
START = 400  # frequencies at which the search for the largest value begins


def _largest_exactly(num: Poly, den: Poly) -> tuple[float, float]:
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


def largest(T: DelayedTransfer, *near: float) -> tuple[float, float]:
    """sup |T(jw)| of a stable T, to 1e-7 with dead times, and its w; inf: as w grows.

    ``near``: frequencies at which |T| is known to be large, which shorten the search.
    """
    if T.num.rational and T.den.rational:
        return _largest_exactly(T.num.polynomial, T.den.polynomial)
    best, at = _higher((_size(T, 0.0), 0.0), (_limit(T), math.inf))
    if math.isinf(best):
        return best, at
    N, D = T.num.squared(), T.den.squared()
    w = np.append(near, np.geomspace(1e-6, 1.0, START) * (reach(D) or 1.0))
    best, at = _higher((best, at), _top(T, w))
    for _ in range(LEVELS):
        level = Fraction(best * (1 + RISE)) ** 2
        found = signs(D.scaled(level) + N.scaled(-1))
        ends = np.array([0.0, *found.changes])
        places = np.concatenate([np.sqrt(ends[1:-1] * ends[2:]), ends[-1:] * 2, found.touches])
        if found.first > 0 and not found.changes and not found.touches:
            return best, at
        higher = _higher((best, at), _top(T, places))
        if higher[0] <= best * (1 + RISE):
            return higher
        best, at = higher
    return best, at


def _higher(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """The larger of two values with their places, the first where rounding decides."""
    return b if b[0] > a[0] * (1 + SAME) else a


def _size(T: DelayedTransfer, w: float) -> float:
    return abs(T(1j * w))


def _top(T: DelayedTransfer, w: np.ndarray) -> tuple[float, float]:
    """The largest |T| among frequencies, climbed to its top."""
    sizes = np.abs(T(1j * w))
    k = int(np.argmax(np.where(np.isfinite(sizes), sizes, 0.0)))
    late = max(T.dead_times, default=0.0)
    width = min(0.05 * w[k], 0.5 / late) if late else 0.05 * w[k]
    found: Any = minimize_scalar(
        lambda x: -_size(T, x),
        bounds=(w[k] - width, w[k] + width),
        method="bounded",
        options={"xatol": 1e-10 * w[k]},
    )
    return max((float(sizes[k]), float(w[k])), (_size(T, found.x), float(found.x)))


def _limit(T: DelayedTransfer) -> float:
    """The largest |T(jw)| as w grows without end, of a stable T."""
    if T.num.degree > T.den.degree:
        return math.inf
    return max(map(abs, limits(T)), default=0.0)


def limits(T: DelayedTransfer) -> tuple[float, ...]:
    """The real values that T(jw) takes again and again, or tends to, as w grows; none for 0 and
    infinity."""
    if T.num.degree != T.den.degree:
        return ()
    top, bottom = T.num.leading, T.den.leading
    late = sorted({*top, *bottom})
    if len(late) > 2:
        raise InputError(
            "the gain as w grows is undecided: several dead times act on the highest power of s; "
            "add the lag that the drive has."
        )
    if len(late) == 1:
        return (float(top[late[0]] / bottom[late[0]]),)
    # (a + b z)/(c + d z) is a circle about the real axis, which it crosses at z = 1 and z = -1.
    a, b, c, d = (p.get(k, Fraction(0)) for p in (top, bottom) for k in late)
    return tuple(float(n / m) if m else math.inf for n, m in ((a + b, c + d), (a - b, c - d)))
