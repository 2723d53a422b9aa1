"""C(s) of the loops as exact polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ..core.errors import InputError
from .exact import Poly, add, divide, gcd, mul, poly, scale
from .transfer import number, read_transfer

Ratio = tuple[Poly, Poly]


@dataclass(frozen=True)
class Controller:
    """C(s) = Kp + Kd s/(Td s + 1) + I(s) + X(s), every number exact.

    I(s) is Ki/(tau s + 1) if tau > 0, Ki/(s + leak) if leak > 0, else Ki/s. Td is
    ``derivative_filter``; X is ``added``, any further term of C in lowest terms.
    """

    kp: Fraction
    ki: Fraction
    kd: Fraction
    tau: Fraction
    derivative_filter: Fraction
    leak: Fraction
    added: Ratio = ((), (1,))

    @property
    def integral(self) -> Ratio:
        """I(s); without integral action 0/1, so that no common factor s appears."""
        if not self.ki:
            return (), (1,)
        return poly([self.ki]), (1, self.tau) if self.tau else (self.leak, 1)

    @property
    def derivative(self) -> Ratio:
        """Kd s/(Td s + 1)."""
        if not self.kd:
            return (), (1,)
        return (0, self.kd), poly([1, self.derivative_filter])

    @property
    def on_error(self) -> Ratio:
        """C(s) without the derivative action."""
        num, den = _sum(self.integral, self.added)
        return add(num, scale(den, self.kp)), den

    @property
    def pure_integral(self) -> bool:
        return bool(self.ki) and not self.tau and not self.leak


def read_controller(
    kp: Any, ki: Any, kd: Any, tau: Any, derivative_filter: Any, leak: Any, controller: Any
) -> Controller:
    """C(s) from the user's values; InputError if one is not a number, negative, or given twice."""
    gains = (number(kp, "kp"), number(ki, "ki"), number(kd, "kd"))
    lag = _not_negative(tau, "tau", "s")
    smoothing = _not_negative(derivative_filter, "derivative_filter", "s")
    rate = _not_negative(leak, "leak", "1/s")
    if lag and rate:
        raise InputError(
            "tau and leak are both given, but the integral action is Ki/(tau s + 1) or "
            "Ki/(s + leak); give one of them."
        )
    given = ((), (1,)) if controller is None else read_transfer(controller, "C")[:2]
    return Controller(*gains, lag, smoothing, rate, given)


def _not_negative(value: Any, name: str, unit: str) -> Fraction:
    exact = number(0 if value is None else value, name)
    if exact < 0:
        kind = "leak rate" if name == "leak" else "time constant"
        raise InputError(f"{name} is {float(exact):g} {unit}, but a {kind} cannot be negative.")
    return exact


def _sum(a: Ratio, b: Ratio) -> Ratio:
    """a + b over the least common denominator, so that no shared pole is counted twice."""
    if not b[0]:
        return a
    shared = gcd(a[1], b[1])
    left, right = divide(a[1], shared)[0], divide(b[1], shared)[0]
    return add(mul(a[0], right), mul(b[0], left)), mul(a[1], right)
