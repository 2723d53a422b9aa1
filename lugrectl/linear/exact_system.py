"""Systems of one input and output with exact coefficients: T(s), also with dead times, and T(z)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import control as ct

from .axis import signs, zeros
from .border import Axis, border_of, says_hidden
from .delayed import DelayedTransfer, reduced
from .exact import Poly
from .peaks import largest
from .quasi import Quasi
from .realness import realness
from .transfer import coefficients, require_siso
from .verdict import Falls, NoGain, Realness


@dataclass(frozen=True)
class ExactSystem:
    """T(s), or T(z) as a function of v; ``given`` is T in its own variable."""

    given: DelayedTransfer
    border: Axis = Axis()
    size, said = "|T|", ""
    meaning = "||y||_2 <= {:.6g} ||u||_2 from rest"

    @classmethod
    def of(cls, T: Any, name: str = "T") -> ExactSystem:
        """Raises InputError, which calls T ``name``, for anything else than the checks take."""
        if isinstance(T, DelayedTransfer):
            return cls(T)
        if isinstance(T, ct.TransferFunction | ct.StateSpace):
            require_siso(T, name)
        num, den = (Quasi.of([(0, p)]) for p in coefficients(T, name))
        return cls(reduced(num, den), border_of(T))

    @cached_property
    def num(self) -> Quasi:
        return self.on_axis(self.given.num)

    @cached_property
    def den(self) -> Quasi:
        return self.on_axis(self.given.den)

    def on_axis(self, q: Quasi) -> Quasi:
        """q in the variable whose imaginary axis the frequencies lie on."""
        if self.border.dt is None:
            return q
        return Quasi.of([(0, self.border.mapped(q.polynomial, self.degree))])

    @property
    def degree(self) -> int:
        return max(self.given.num.degree, self.given.den.degree)

    @property
    def excess(self) -> int:
        """The relative degree."""
        return self.given.den.degree - self.given.num.degree

    @property
    def rational(self) -> bool:
        return self.given.num.rational and self.given.den.rational

    @property
    def ratio(self) -> tuple[Poly, Poly]:
        """Numerator and denominator of a rational T in the variable of the axis."""
        return self.num.polynomial, self.den.polynomial

    @cached_property
    def stable(self) -> bool:
        if self.rational:
            return self.border.stable(self.given.den.polynomial)
        return not self.why_unstable(self.given.den)

    @cached_property
    def poles(self) -> tuple[complex, ...]:
        """Of a rational T, the least stable first (floats: for display, not for decisions)."""
        return self.border.roots(self.given.den.polynomial) if self.rational else ()

    @property
    def seen(self) -> str:
        """The poles of T, or how many are not stable, in words."""
        return self.border.show(self.poles) if self.rational else self.why_unstable(self.given.den)

    @property
    def hidden(self) -> str:
        """A remark on a mode that is not stable and cancelled from T; empty without one."""
        return says_hidden(self.border, self.given.cancelled)

    def why_unstable(self, den: Quasi) -> str:
        """The poles of a system with this denominator that are not stable; empty where all are."""
        if self.border.dt and self.border.stable(den.polynomial):
            return ""
        right, origin, on_axis = zeros(self.on_axis(den))
        if math.isinf(right):
            return (
                "infinitely many poles right of the imaginary axis, or as near to it as any: a "
                "dead time acts on the highest power of s"
            )
        if right:
            return f"{right:.0f} pole{'s' * (right != 1)} {self.border.outside}"
        if not origin and on_axis is None and self.border.dt is None:
            return ""
        v = on_axis if on_axis is not None else 0.0 if origin else math.inf
        return f"a pole {self.border.on}, at w = {self.border.frequency(v):.6g} rad/s"

    def falls(self, power: Fraction) -> Falls:
        """Where |T|^2 crosses ``power`` times its value at w = 0."""
        top, bottom = self.num.taylor(0), self.den.taylor(0)
        if not top or not bottom:
            return Falls(math.inf if top else 0.0)
        level = self.den.squared().scaled(-power * top**2)
        found = signs(self.num.squared().scaled(bottom**2) + level).changes
        at = tuple(map(self.border.frequency, found))
        return Falls(abs(float(top / bottom)), at, min(at, default=math.inf))

    def no_gain(self) -> NoGain | None:
        """Why T has no L2 gain; None where it has one."""
        T = f"T({self.border.variable})"
        if not self.stable:
            return NoGain(f"{T} is not stable ({self.seen})")
        if self.border.has_outside(self.given.cancelled):
            return NoGain(self.hidden)
        if self.excess >= 0:
            return None
        if self.border.dt:
            return NoGain(f"{T} is improper: it needs the input ahead")
        return NoGain(f"{T} is improper: |T| grows with w without bound", math.inf)

    def largest(self) -> tuple[float, float]:
        """The largest |T(jw)| of a stable T, and the w at which it is; inf: as w grows."""
        gain, v = largest(DelayedTransfer(self.num, self.den))
        return gain, self.border.frequency(v)

    def realness(self) -> Realness:
        """How real T is, with its reason in words, its band edge and margin."""
        return realness(self)
