"""Quasi-polynomials: sums of p(s) exp(-sT) with exact coefficients and exact dead times T."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce

import numpy as np

from .exact import Poly, add, derivative, divide, gcd, mul, scale, shift

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
            merged[late] = add(merged.get(late, ()), p)
        return cls(tuple(sorted((late, p) for late, p in merged.items() if p)))

    def __add__(self, other: Quasi) -> Quasi:
        return Quasi.of((*self.terms, *other.terms))

    def __mul__(self, other: Quasi) -> Quasi:
        return Quasi.of((a + b, mul(p, q)) for a, p in self.terms for b, q in other.terms)

    def __bool__(self) -> bool:
        return bool(self.terms)

    def scaled(self, c: Fraction | int) -> Quasi:
        """c q."""
        return Quasi.of((late, scale(p, c)) for late, p in self.terms)

    def later(self, more: Fraction | int) -> Quasi:
        """q exp(-s more)."""
        return Quasi.of((late + more, p) for late, p in self.terms)

    def mirror(self) -> Quasi:
        """q(-s): on the imaginary axis the conjugate of q."""
        return self.stretched(-1)

    def squared(self) -> Quasi:
        """|q(jw)|^2 as an even quasi-polynomial."""
        return self * self.mirror()

    def stretched(self, unit: Fraction | int) -> Quasi:
        """q(unit s)."""
        return Quasi.of(
            (late * unit, tuple(c * unit**i for i, c in enumerate(p))) for late, p in self.terms
        )

    def derivative(self) -> Quasi:
        """dq/ds."""
        return Quasi.of((late, add(derivative(p), scale(p, -late))) for late, p in self.terms)

    def shifted(self, eps: float) -> Quasi:
        """q(s - eps), the exponentials rounded."""
        return Quasi.of(
            (late, scale(shift(p, Fraction(eps)), Fraction(math.exp(eps * float(late)))))
            for late, p in self.terms
        )

    def over(self, p: Poly) -> Quasi:
        """q/p, where p divides every term."""
        return Quasi.of((late, divide(q, p)[0]) for late, q in self.terms)

    def common(self) -> Poly:
        """The greatest common divisor of the polynomials."""
        return reduce(gcd, (p for _, p in self.terms), ())

    @property
    def rational(self) -> bool:
        """Whether it is a polynomial."""
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
        """q(s), elementwise."""
        total = np.zeros(np.shape(s), dtype=complex)
        for late, row in zip(*self._numbers, strict=True):
            total = total + np.polynomial.polynomial.polyval(s, row) * np.exp(-s * late)
        return total

    def bound(self, w: np.ndarray) -> np.ndarray:
        """What |q| does not exceed on the imaginary axis up to w."""
        if not self.terms:
            return np.zeros(np.shape(w))
        return np.polynomial.polynomial.polyval(w, np.abs(self._numbers[1]).sum(axis=0))
