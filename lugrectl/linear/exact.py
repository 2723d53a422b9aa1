"""Polynomials with exact rational coefficients: division, real roots, Hurwitz test.

A polynomial is a tuple of numbers in ascending powers without trailing zeros; ``()`` is zero. Sums
of p(s) exp(-sT) with exact dead times T are quasi-polynomials.
No decision here is made in floating point; floats appear only as values of isolated roots.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from itertools import pairwise, zip_longest

import numpy as np

Poly = tuple[Fraction | int, ...]


def poly(coefficients: Iterable[Fraction | int]) -> Poly:
    """Ascending coefficients without the trailing zeros."""
    p = list(coefficients)
    while p and p[-1] == 0:
        p.pop()
    return tuple(p)


def add(a: Poly, b: Poly) -> Poly:
    return poly(x + y for x, y in zip_longest(a, b, fillvalue=0))


def mul(a: Poly, b: Poly) -> Poly:
    out: list[Fraction | int] = [0] * (len(a) + len(b))
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return poly(out)


def scale(a: Poly, c: Fraction | int) -> Poly:
    return poly(c * x for x in a)


def divide(a: Poly, b: Poly) -> tuple[Poly, Poly]:
    """Quotient and remainder of a / b."""
    rest, quotient = list(a), [Fraction(0)] * max(len(a) - len(b) + 1, 0)
    for k in range(len(quotient) - 1, -1, -1):
        q = quotient[k] = Fraction(rest[k + len(b) - 1]) / b[-1]
        for i, y in enumerate(b):
            rest[k + i] -= q * y
    return poly(quotient), poly(rest)


def derivative(a: Poly) -> Poly:
    return poly(i * c for i, c in enumerate(a) if i)


def at(a: Poly, x: Fraction | int) -> Fraction | int:
    value: Fraction | int = 0
    for c in reversed(a):
        value = value * x + c
    return value


def primitive(a: Poly) -> tuple[int, ...]:
    """A positive multiple of a with coprime integer coefficients."""
    if not a:
        return ()
    common = math.lcm(*(Fraction(c).denominator for c in a))
    whole = [int(c * common) for c in a]
    divisor = math.gcd(*whole)
    return tuple(c // divisor for c in whole)


def remainder(a: tuple[int, ...], b: tuple[int, ...]) -> Poly:
    """A positive multiple of the remainder of a / b, in whole numbers."""
    rest, lead = list(a), abs(b[-1])
    for k in range(len(a) - len(b), -1, -1):
        q = rest.pop() * (1 if b[-1] > 0 else -1)
        rest = [lead * c for c in rest]
        for i, y in enumerate(b[:-1]):
            rest[k + i] -= q * y
    return poly(rest)


def gcd(a: Poly, b: Poly) -> Poly:
    a, b = primitive(a), primitive(b)
    while b:
        a, b = b, primitive(remainder(a, b))
    return scale(a, -1) if a and a[-1] < 0 else a


def shift(a: Poly, eps: Fraction) -> Poly:
    p = list(a)
    for i in range(len(p) - 1):
        for k in range(len(p) - 2, i - 1, -1):
            p[k] -= eps * p[k + 1]
    return tuple(p)


def even_odd(a: Poly) -> tuple[Poly, Poly]:
    """The parts e, o of a(jw) = e(x) + j w o(x), x = w^2."""
    signed = [c * (-1) ** (i // 2) for i, c in enumerate(a)]
    return poly(signed[0::2]), poly(signed[1::2])


def real_product(a: Poly, b: Poly) -> Poly:
    """Re(a(jw) conj b(jw)) as a polynomial in x = w^2; |a|^2 when b is a."""
    (ae, ao), (be, bo) = even_odd(a), even_odd(b)
    return add(mul(ae, be), mul((0, 1), mul(ao, bo)))


def squarefree(a: Poly) -> list[Poly]:
    """Square-free factors f1, f2, ... with a = c f1 f2^2 f3^3 ..."""
    repeated = gcd(a, derivative(a))
    rest, factors = divide(a, repeated)[0], []
    while len(rest) > 1:
        common = gcd(rest, repeated)
        factors.append(divide(rest, common)[0])
        rest, repeated = common, divide(repeated, common)[0]
    return factors


def distinct_roots(a: Poly) -> Poly:
    """A polynomial with every root of a, once each."""
    return divide(a, gcd(a, derivative(a)))[0]


def odd_roots(a: Poly) -> Poly:
    """A polynomial with the roots of odd multiplicity of a, once each: a changes sign there."""
    return reduce(mul, squarefree(a)[0::2], (1,))


def sturm(a: Poly) -> list[tuple[int, ...]]:
    chain = [primitive(a), primitive(derivative(a))]
    while chain[-1]:
        chain.append(primitive(scale(remainder(chain[-2], chain[-1]), -1)))
    return chain[:-1]


def sign_at(a: tuple[int, ...], x: Fraction | None) -> int:
    """Sign of a(x), of a at +infinity when x is None; integer arithmetic only."""
    if x is None:
        value = a[-1]
    else:
        value, power = 0, 1
        for c in reversed(a):
            value = value * x.numerator + c * power
            power *= x.denominator
    return (value > 0) - (value < 0)


def changes(chain: list[tuple[int, ...]], x: Fraction | None) -> int:
    """Sign changes along the chain at x; their decrease over (a, b] is the number of roots."""
    signs = [s for s in (sign_at(a, x) for a in chain) if s]
    return sum(s != t for s, t in pairwise(signs))


def count_positive(a: Poly) -> int:
    """Number of roots in (0, inf) of a square-free a."""
    if all(c >= 0 for c in a) or all(c <= 0 for c in a):
        return 0
    chain = sturm(a)
    return changes(chain, Fraction(0)) - changes(chain, None)


def positive_roots(a: Poly) -> list[float]:
    """Roots in (0, inf) of a square-free a, ascending, to about the last digit."""
    if not count_positive(a):
        return []
    chain = sturm(a)
    # Cauchy's bound, rounded up to a power of two so that every bisection point is dyadic.
    bound = 1 + max(abs(Fraction(c, chain[0][-1])) for c in chain[0])
    top = Fraction(2 ** math.ceil(bound).bit_length())
    found, todo = [], [(Fraction(0), top, changes(chain, Fraction(0)), changes(chain, top))]
    while todo:
        low, high, at_low, at_high = todo.pop()
        if at_low - at_high == 1:
            found.append(_refine(chain[0], low, high))
        elif at_low > at_high:
            mid = (low + high) / 2
            at_mid = changes(chain, mid)
            todo += [(mid, high, at_mid, at_high), (low, mid, at_low, at_mid)]
    return found


def _refine(a: tuple[int, ...], low: Fraction, high: Fraction) -> float:
    """The only root in (low, high]; low itself may be a root of another interval."""
    above = sign_at(a, high)
    while above and high - low > high / 2**56:
        mid = (low + high) / 2
        sign = sign_at(a, mid)
        if sign in (0, above):
            high, above = mid, sign
        else:
            low = mid
    return float(high)


def nonnegative(a: Poly) -> bool:
    """Whether a(x) >= 0 on [0, inf)."""
    if all(c >= 0 for c in a):
        return True
    return a[-1] > 0 and a[0] >= 0 and not count_positive(odd_roots(a))


def positive(a: Poly) -> bool:
    """Whether a(x) > 0 on [0, inf)."""
    return bool(a) and a[0] > 0 and a[-1] > 0 and not count_positive(distinct_roots(a))


def hurwitz(a: Poly) -> bool:
    """Whether every root has a negative real part (Routh); true for a constant, not for zero."""
    p = primitive(a[::-1])
    while len(p) > 1:
        if p[0] * p[1] <= 0:
            return False
        size, ratio = abs(p[1]), abs(p[0])
        row = [size * c - ratio * d for c, d in zip_longest(p[2::2], p[3::2], fillvalue=0)]
        common = math.gcd(*row) or 1
        rows = zip_longest(p[1::2], [c // common for c in row])
        p = tuple(c for pair in rows for c in pair if c is not None)
    return bool(p)


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


def axis_roots(a: Poly) -> tuple[list[float], bool]:
    """Frequencies w >= 0 of the roots on the imaginary axis, and whether any lies right of it."""
    zeros = next(i for i, c in enumerate(a) if c)
    rest = a[zeros:]
    symmetric = gcd(*even_odd(rest))  # in x = w^2: the roots s whose mirror -s is a root too
    mirror = poly(
        0 if i % 2 else symmetric[i // 2] * (-1) ** (i // 2) for i in range(2 * len(symmetric) - 1)
    )
    single = distinct_roots(symmetric)
    on_axis = [math.sqrt(x) for x in positive_roots(single)]
    right = len(on_axis) < len(single) - 1 or not hurwitz(divide(rest, mirror)[0])
    return [0.0] * bool(zeros) + on_axis, right


Term = tuple[Fraction | int, Poly]


@dataclass(frozen=True)
class Quasi:
    """The sum of p(s) exp(-sT) over ``terms`` (T in s, p), by ascending T, no p zero."""

    terms: tuple[Term, ...]

    @classmethod
    def of(cls, terms: Iterable[Term]) -> Quasi:
        """The sum of terms, those of one dead time together."""
        merged: dict[Fraction | int, Poly] = {}
        for late, p in terms:
            merged[late] = add(merged[late], p) if late in merged else poly(p)
        return cls(tuple(sorted((late, p) for late, p in merged.items() if p)))

    def __add__(self, other: Quasi) -> Quasi:
        return Quasi.of((*self.terms, *other.terms))

    def __mul__(self, other: Quasi) -> Quasi:
        return Quasi.of((a + b, mul(p, q)) for a, p in self.terms for b, q in other.terms)

    def __bool__(self) -> bool:
        return bool(self.terms)

    def scaled(self, c: Fraction | int) -> Quasi:
        return Quasi.of((late, scale(p, c)) for late, p in self.terms)

    def later(self, more: Fraction | int) -> Quasi:
        return Quasi.of((late + more, p) for late, p in self.terms)

    def mirror(self) -> Quasi:
        """q(-s): on the imaginary axis the conjugate of q."""
        return self.stretched(-1)

    def real_product(self, other: Quasi) -> Quasi:
        """Re(q(jw) conj other(jw)) as an even quasi-polynomial; |q(jw)|^2 when other is q."""
        if self.rational and other.rational:
            in_x = real_product(self.polynomial, other.polynomial)
            return Quasi.of([(0, poly(c for k, x in enumerate(in_x) for c in (x * (-1) ** k, 0)))])
        whole = self * other.mirror()
        return (whole + whole.mirror()).scaled(Fraction(1, 2))

    def squared(self) -> Quasi:
        return self.real_product(self)

    def stretched(self, unit: Fraction | int) -> Quasi:
        return Quasi.of(
            (late * unit, tuple(c * unit**i for i, c in enumerate(p))) for late, p in self.terms
        )

    def derivative(self) -> Quasi:
        return Quasi.of((late, add(derivative(p), scale(p, -late))) for late, p in self.terms)

    def shifted(self, eps: float | Fraction) -> Quasi:
        """q(s - eps), the exponentials rounded."""
        return Quasi.of(
            (late, scale(shift(p, Fraction(eps)), Fraction(math.exp(float(eps * late)))))
            for late, p in self.terms
        )

    def over(self, p: Poly) -> Quasi:
        return Quasi.of((late, divide(q, p)[0]) for late, q in self.terms)

    def common(self) -> Poly:
        return reduce(gcd, (p for _, p in self.terms), ())

    @property
    def rational(self) -> bool:
        return all(not late for late, _ in self.terms)

    @property
    def polynomial(self) -> Poly:
        """The term without a dead time."""
        return next((p for late, p in self.terms if not late), ())

    @property
    def degree(self) -> int:
        """The highest power of s, -1 of zero."""
        return max((len(p) for _, p in self.terms), default=0) - 1

    @property
    def leading(self) -> dict[Fraction | int, Fraction]:
        """The coefficients of the highest power of s, by dead time."""
        return {late: Fraction(p[-1]) for late, p in self.terms if len(p) - 1 == self.degree}

    def taylor(self, power: int) -> Fraction:
        """The coefficient of s^power of the series about s = 0."""
        total = Fraction(0)
        for late, p in self.terms:
            for i, c in enumerate(p[: power + 1]):
                k = power - i
                total += Fraction(c) * (-Fraction(late)) ** k / math.factorial(k)
        return total

    def order(self) -> int:
        """The multiplicity of the zero at s = 0."""
        # A quasi-polynomial with this many coefficients vanishes to a lower order, or is zero.
        most = sum(len(p) for _, p in self.terms)
        return next((k for k in range(most) if self.taylor(k)), most)

    @cached_property
    def _numbers(self) -> tuple[np.ndarray, np.ndarray]:
        """Dead times, and coefficients by dead time and power, as floats."""
        coefficients = np.zeros((len(self.terms), self.degree + 1))
        for row, (_, p) in zip(coefficients, self.terms, strict=True):
            row[: len(p)] = [float(c) for c in p]
        return np.array([float(late) for late, _ in self.terms]), coefficients

    def at(self, s: np.ndarray) -> np.ndarray:
        total = np.zeros(np.shape(s), dtype=complex)
        for late, row in zip(*self._numbers, strict=True):
            total = total + np.polynomial.polynomial.polyval(s, row) * np.exp(-s * late)
        return total

    def bound(self, w: np.ndarray) -> np.ndarray:
        """What |q| does not exceed on the imaginary axis up to w."""
        if not self.terms:
            return np.zeros(np.shape(w))
        return np.polynomial.polynomial.polyval(w, np.abs(self._numbers[1]).sum(axis=0))
