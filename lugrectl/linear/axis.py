"""Quasi-polynomials on the imaginary axis: where the sign changes, and zeros right of the axis.

In a cell about w0 of half-width h, |q(jw) - q(jw0)| <= |q'(jw0)| h + M h^2/2, where M bounds |q''|
up to the cell's end. A cell in which this is below |q(jw0)| holds no zero; one in which M h is
below |q'(jw0)| holds at most one change of sign; every other is halved. So nothing is missed
between points of a grid.

With this the largest |T(jw)| and the least Re T(jw) are found: exactly of rational numbers, else
between bounds.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ..core.errors import InputError
from .delayed import DelayedTransfer
from .exact import (
    Poly,
    Quasi,
    add,
    at,
    axis_roots,
    derivative,
    even_odd,
    hurwitz,
    mul,
    odd_roots,
    positive_roots,
    real_product,
    scale,
    squarefree,
)
from .system import Signs
from .transfer import TINY, roots, to_float

ROUNDING = 1e-14  # of the sum of its terms: what floating point does not resolve of a value
PER_OCTAVE = 4
CELLS = 2_000_000
SMALL = 2.0**-48
WINDOWS = 16  # octaves that are searched for the first changes of a sign that never settles


def signs(F: Quasi, end: float | None = None) -> Signs:
    """The signs of F(jw), w > 0, of an even F, which is real there; up to ``end``, where given.
    Where the sign never settles as w grows, the changes of the first octaves that have any."""
    if not F:
        return Signs(0)
    if F.rational:
        return signs_in_x(even_odd(F.polynomial)[0])
    end = settled(F) if end is None else end
    if end is not None:
        return _signs(F, end)
    unit, found = 1.0 / max(abs(float(late)) for late, _ in F.terms), Signs(0)
    for _ in range(WINDOWS):
        unit *= 2.0
        found = _signs(F, unit)
        if len(found.edges) > 1:
            break
    if not found.edges:
        raise InputError(
            "as w grows, the sign of a condition on T(jw) stays undecided: its dead times act on "
            "the highest power of s; add the lag that the drive has."
        )
    return found._replace(complete=False)


def signs_in_x(a: Poly) -> Signs:
    """The same of a polynomial in x = w^2."""
    factors = squarefree(a)
    odd, even = (positive_roots(reduce(mul, factors[k::2], (1,))) for k in (0, 1))
    first = 1 if next(c for c in a if c) > 0 else -1
    return Signs.exact(first, map(math.sqrt, odd), map(math.sqrt, even))


def settled(F: Quasi) -> float | None:
    """A frequency in rad/s above which the sign of an even F stays; None where it may never."""
    if [late for late, _ in F.terms[1:]] != [0, -F.terms[0][0]]:
        return reach(F)
    # F0 + 2 Re(F1 exp(-jwT)) has the sign of F0 where F0^2 > 4 |F1|^2
    own, late = Quasi.of([(0, F.polynomial)]), Quasi.of(F.terms[2:])
    x = even_odd((own * own + (late * late.mirror()).scaled(-4)).polynomial)[0]
    if not x or x[-1] <= 0:
        return None
    return max(math.sqrt(_outermost([abs(Fraction(c)) for c in x])), TINY)


def reach(q: Quasi) -> float | None:
    """A frequency in rad/s above which, and |s| above which right of the axis, the highest power of
    s without dead time outweighs the rest; None where it never does."""
    last, most = q.leading, q.degree
    own = abs(last.pop(0, Fraction(0))) - sum(map(abs, last.values()))
    if own <= 0:
        return None
    sizes = [
        sum((abs(Fraction(p[i])) for _, p in q.terms if i < len(p)), Fraction(0))
        for i in range(most)
    ]
    return _outermost([*sizes, own]) or 1.0


def _outermost(sizes: list[Fraction]) -> float:
    """Fujiwara's bound on the roots of a polynomial with coefficients of these sizes."""
    most = len(sizes) - 1
    ratios = [(c / sizes[-1], most - i) for i, c in enumerate(sizes[:-1]) if c]
    logs = [(math.log(c.numerator) - math.log(c.denominator)) / k for c, k in ratios]
    return 2.0 * math.exp(max(logs)) if logs else 0.0


class Zeros(NamedTuple):
    """Zeros right of the imaginary axis, at s = 0, and the frequency of one elsewhere on the axis;
    with one ``right`` is a lower bound, inf: dead times act on the highest power of s too much."""

    right: float
    origin: int = 0
    on_axis: float | None = None


def zeros(q: Quasi) -> Zeros:
    """How many zeros are not left of the imaginary axis: the argument of q(jw) is followed to
    ``reach``, beyond which it is that of the leading terms."""
    if q.rational:
        p = q.polynomial
        if hurwitz(p):
            return Zeros(0)
        right = sum(s.real > TINY * abs(s) for s in roots(p))
        return Zeros(right, q.order(), next(filter(None, axis_roots(p)[0]), None))
    end = reach(q)
    if end is None:
        last = q.leading
        own, late = abs(last.pop(0, Fraction(0))), sorted(map(abs, last.values()))
        # Of one dead time and equal sizes, a chain of zeros comes as near to the axis as any.
        if own and len(late) > 1 and late[-1] <= own + sum(late[:-1]):
            raise InputError(
                "stability is undecided: several dead times act on the highest power of s; add "
                "the lag that the drive has."
            )
        return Zeros(math.inf, q.order())
    p, unit = _sized(q, end)
    low, m = _start(p)
    lowest = float(p.taylor(m)) * (1j * low) ** m
    turned = float(np.angle(p.at(np.array([1j * low])) / lowest)[0])
    if low < 1.0:
        a, b, undecided = _cells(p, *_octaves(low), monotone=False)
        if undecided.any():
            return Zeros(0, m, 0.5 * float((a + b)[undecided][0]) * unit)
        turned += float(np.angle(p.at(1j * b) / p.at(1j * a)).sum())
    at_end = p.at(np.array([1j * max(low, 1.0)]))[0]
    top = float(np.angle(at_end / (float(p.leading[0]) * 1j**p.degree)))
    return Zeros(round((p.degree - m) / 2 + (top - turned) / math.pi), m)


def _signs(F: Quasi, end: float) -> Signs:
    f, unit = _sized(F, end)
    low, m = _start(f)
    first = 1 if f.taylor(m) * (-1) ** (m // 2) > 0 else -1
    if low >= 1.0:
        return Signs(first)
    a, b, undecided = _cells(f, *_octaves(low), monotone=True)
    ends = np.real(f.at(1j * np.append(a, b[-1])))
    ends[0] = first
    changed = (ends[1:] < 0) != (ends[:-1] < 0)
    changes = [
        _between(f, a[k], b[k], ends[k], ends[k + 1]) * unit for k in np.flatnonzero(changed)
    ]
    touches = (0.5 * (a + b)[undecided & ~changed] * unit).tolist()
    apart = [w for k, w in enumerate(touches) if not k or w > touches[k - 1] * (1 + 1e-5)]
    return Signs.exact(first, changes, apart)


def _between(f: Quasi, a: float, b: float, at_a: float, at_b: float) -> float:
    def value(w: float) -> float:
        return float(f.at(np.array([1j * w]))[0].real)

    if value(a) * value(b) >= 0:
        return float(a if abs(at_a) < abs(at_b) else b)
    found: Any = brentq(value, a, b, xtol=1e-300, rtol=np.float64(1e-14))
    return float(found)


def _start(f: Quasi) -> tuple[float, int]:
    """Up to which w the lowest power of the series outweighs the rest, and the power."""
    m = f.order()
    lowest = abs(float(f.taylor(m))) * math.factorial(m + 1)
    rest = f
    for _ in range(m + 1):
        rest = rest.derivative()
    w = 1.0
    while float(rest.bound(np.array(w))) * w >= lowest and w > 1e-300:
        w *= 0.5
    return w, m


def _cells(
    q: Quasi, a: np.ndarray, b: np.ndarray, monotone: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells in which nothing is hidden, ascending, and which of them rounding leaves undecided."""
    slope, bend = q.derivative(), q.derivative().derivative()
    done: list[tuple[np.ndarray, ...]] = []
    many = 0
    while len(a):
        many += len(a)
        if many > CELLS:
            raise InputError(
                "the response turns too often to be followed: dead time times bandwidth is above "
                "about 1e5; check the unit of the dead time, s."
            )
        middle, h = 0.5 * (a + b), 0.5 * (b - a)
        value, rate = q.at(1j * middle), 1j * slope.at(1j * middle)
        if monotone:
            value, rate = np.real(value), np.real(rate)
        curved, noise = bend.bound(b) * h, ROUNDING * q.bound(b)
        clear = np.abs(value) > np.abs(rate) * h + 0.5 * curved * h + noise
        if monotone:
            clear |= np.abs(rate) > curved + ROUNDING * slope.bound(b)
        lost = ~clear & ((np.abs(value) + np.abs(rate) * h < noise) | (h < SMALL * b))
        over = clear | lost
        done.append((a[over], b[over], lost[over]))
        a, b, middle = a[~over], b[~over], middle[~over]
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
    low, high, lost = (np.concatenate(part) for part in zip(*done, strict=True))
    order = np.argsort(low)
    return low[order], high[order], lost[order]


def _octaves(low: float) -> tuple[np.ndarray, np.ndarray]:
    """Cells from ``low`` to 1."""
    ends = np.geomspace(low, 1.0, math.ceil(-PER_OCTAVE * math.log2(low)) + 1)
    ends[[0, -1]] = low, 1.0
    return ends[:-1], ends[1:]


def _sized(q: Quasi, end: float) -> tuple[Quasi, float]:
    """q, its largest coefficient near 1, of frequencies in a unit from ``end`` on; and the unit."""
    unit = Fraction(2) ** math.ceil(math.log2(end))
    q = q.stretched(unit)
    largest = max(abs(Fraction(c)) for _, p in q.terms for c in p)
    exponent = largest.numerator.bit_length() - largest.denominator.bit_length()
    return q.scaled(1 / Fraction(2) ** exponent), float(unit)


RISE = 1e-7  # of the gain: nothing is above it by more
SAME = 1e-12
LEVELS = 60
START = 400  # frequencies at which the search for the largest value begins
TURNS = 4 * math.pi  # of the shortest dead time, up to which they go


def largest(T: DelayedTransfer) -> tuple[float, float]:
    """sup |T(jw)| of a stable T, to 1e-7 with dead times, and its w; inf: as w grows."""
    if T.num.degree > T.den.degree:
        return math.inf, math.inf
    if T.num.rational and T.den.rational:
        return _largest_ratio(*(real_product(q.polynomial, q.polynomial) for q in (T.num, T.den)))
    limit = max(map(abs, limits(T)), default=0.0)
    best, at = _higher((abs(T(0j)), 0.0), (limit, math.inf))
    if math.isinf(best):
        return best, at
    far = reach(T.den.squared()) or 1.0  # beyond it T nears its limits, as far as it may turn
    w = np.geomspace(1e-6 * far, max(far, min(TURNS / T.dead_times[0], far / RISE)), START)
    best, at = _higher((best, at), _top(T, w))
    for _ in range(LEVELS):
        found = signs(T.num.squared() + T.den.squared().scaled(-(Fraction(best * (1 + RISE)) ** 2)))
        ends, touches = np.array([0.0, *found.changes]), [e.at for e in found.touches]
        places = np.concatenate([np.sqrt(ends[1:-1] * ends[2:]), ends[-1:] * 2, touches])
        if found.first < 0 and not found.edges and not found.touches:
            return best, at
        higher = _higher((best, at), _top(T, places))
        if higher[0] <= best * (1 + RISE):
            return higher
        best, at = higher
    return best, at


def _largest_ratio(N: Poly, D: Poly) -> tuple[float, float]:
    """The root of the largest N(x)/D(x) on x = w^2 >= 0, and w."""
    # N/D has it at x = 0, as x grows, or where N'D - N D' changes its sign
    slope = add(mul(derivative(N), D), scale(mul(N, derivative(D)), -1))
    places = [Fraction(0), *map(Fraction, positive_roots(odd_roots(slope)))] if slope else [0]
    size = {math.sqrt(to_float(Fraction(x))): Fraction(at(N, x)) / at(D, x) for x in places}
    size.setdefault(math.inf, Fraction(N[-1]) / D[-1] if len(N) == len(D) else Fraction(0))
    w = max(size, key=lambda place: size[place])
    return math.sqrt(to_float(size[w])), w


def _higher(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """The larger of two values with their places, the first where rounding decides."""
    return b if b[0] > a[0] * (1 + SAME) else a


def _top(T: DelayedTransfer, w: np.ndarray) -> tuple[float, float]:
    """The largest |T| among frequencies, climbed to its top."""
    sizes = np.abs(T(1j * w))
    k = int(np.argmax(np.where(np.isfinite(sizes), sizes, 0.0)))
    width = min(0.05 * w[k], 0.5 / max(T.dead_times))
    found: Any = minimize_scalar(
        lambda x: -abs(T(1j * x)),
        bounds=(w[k] - width, w[k] + width),
        method="bounded",
        options={"xatol": 1e-10 * w[k]},
    )
    return max((float(sizes[k]), float(w[k])), (abs(T(1j * found.x)), float(found.x)))


def limits(T: DelayedTransfer) -> tuple[float, ...]:
    """The real values that T(jw) takes again and again, or tends to, as w grows; not 0 or inf."""
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
