"""How far a stable loop is from -1: gain, phase, modulus and delay margin.

Nothing is read off a grid. |L| = 1, Im L = 0 and the peak of |1/(1 + L)| are conditions on
(quasi-)polynomials on the imaginary axis, whose changes of sign ``axis.signs`` isolates, or on the
eigenvalues of a state-space system; a sampled loop is mapped there (:mod:`border`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..core.errors import InputError
from .axis import WINDOWS, Signs, settled, signs, zeros
from .border import Axis
from .delayed import DelayedTransfer
from .exact_system import ExactSystem
from .peaks import largest, level_signs, limits
from .quasi import Quasi
from .state_system import StateSystem
from .verdict import NONE, Margin, show_poles

FAR = 1e100  # rad/s: no crossing is looked for beyond it, where powers of w overflow
SAME = 1e-9  # of |L|: a crossing that is lower by less is not looked for at higher frequencies
Intervals = tuple[tuple[float, float], ...]


class Loop(ABC):
    """A closed loop L/(1 + L), by its open loop; a subclass for each kind of L."""

    alike = 1e-9  # of L at w = 0: closer to 1 is 1
    basis = remark = ""  # what a verdict that it is stable, or any verdict, rests on
    end = NONE  # the factor on L up to which it is known beyond a band
    open_at_infinity = False  # whether |L| is not below 1 as w grows

    def stable_gains(self, crossings: list[tuple[float, float]]) -> Intervals:
        """The intervals of a factor on L, above 0, with which the closed loop is stable.

        Poles reach the axis only at factors that move L to -1: one point of each interval decides.
        None is claimed beyond the largest factor up to which these are known.
        """
        factors = sorted({-1.0 / x for _, x in crossings})
        most = self.known(factors)
        borders = [0.0, *(x for x in factors if x < most), most]
        return tuple(
            (low, high)
            for low, high in pairwise(borders)
            if self.unstable_poles(_between(low, high)) == 0
        )

    @abstractmethod
    def known(self, factors: list[float]) -> float:
        """The factor on L up to which ``factors`` are all that move it to -1."""

    @abstractmethod
    def unstable_poles(self, gain: float) -> float:
        """Poles of the loop with L times ``gain`` that are not stable."""


@dataclass(frozen=True)
class ExactLoop(Loop):
    """L(s), also with dead times, or L(z); ``remark``: what was taken out of it."""

    system: ExactSystem
    remark: str = ""

    def __post_init__(self) -> None:
        if not self.system.given.num + self.system.given.den:
            raise InputError("L(s) is -1, so that the closed loop L/(1 + L) has no solution.")

    @property
    def border(self) -> Axis:
        return self.system.border

    @cached_property
    def L(self) -> DelayedTransfer:
        """L in the variable of the axis."""
        return self.system.axis

    @cached_property
    def counts(self) -> tuple[float, float, float]:
        """Turns about -1, and poles of L and of the closed loop that are not stable."""
        mine, theirs = zeros(self.L.den).right, zeros(self.L.num + self.L.den).right
        turns = mine - theirs if math.isfinite(mine) and math.isfinite(theirs) else math.nan
        return turns, mine, theirs

    @cached_property
    def cause(self) -> str:
        """Why the closed loop is not stable; "" where it is."""
        given = self.system.given
        seen = self.system.why_unstable(given.num + given.den)
        return f"it has {seen}" if seen else self.system.hidden

    @property
    def open_at_infinity(self) -> bool:
        if self.L.num.degree < self.L.den.degree:
            return False
        last = self.L.den.leading
        own = abs(last.pop(0, Fraction(0))) - sum(map(abs, last.values()))
        top = sum(map(abs, self.L.num.leading.values()))
        return own <= 0 or self.L.num.degree > self.L.den.degree or top >= own

    def crossovers(self) -> list[tuple[float, complex]]:
        """Where |L| = 1, crossing or touching: w in rad/s and L there."""
        places = _places(level_signs(self.L, Fraction(1)))
        return [(self.border.frequency(v), self.L(1j * v)) for v in places]

    def real_crossings(self) -> list[tuple[float, float]]:
        """Where L is real and negative: w in rad/s and L there.

        A dead time makes it so at ever higher frequencies; those with the largest |L| below 1 and
        with every |L| above 1 are among them.
        """
        found = [(v, self.L(1j * v).real) for v in self._real_places]
        if self.L.den.taylor(0):
            found.append((0.0, float(self.L.num.taylor(0) / self.L.den.taylor(0))))
        found += [(math.inf, x) for x in limits(self.L)]
        return [(self.border.frequency(v), x) for v, x in found if -math.inf < x < 0]

    @cached_property
    def _real_places(self) -> list[float]:
        """The v > 0 with Im L(jv) = 0."""
        product = self.L.num * self.L.den.mirror()
        odd = product + product.mirror().scaled(-1)
        turned = Quasi.of([(0, (0, 1))]) * odd  # s (N(s) D(-s) - N(-s) D(s)), even
        if not turned or turned.rational or settled(turned) is not None:
            return _places(signs(turned))
        end = max([1.0 / max(self.L.dead_times), *self._level(1.0)])
        places: list[float] = []
        for _ in range(WINDOWS):
            if end > FAR:
                break
            places = _places(signs(turned, end))
            below = [-x for v in places if -1 < (x := self.L(1j * v).real) < 0]
            beyond = self._level(max(below) * (1 - SAME)) if below else [math.inf]
            if beyond and max(beyond) <= end:
                break
            end = max([2.0 * end, *(1.01 * v for v in beyond if math.isfinite(v))])
        return places

    def _level(self, size: float) -> list[float]:
        """Where |L(jv)| = size."""
        try:
            found = level_signs(self.L, Fraction(size) ** 2)
        except (InputError, OverflowError):  # |L| has this size again and again, or too far out
            return [math.inf]
        return [*found.changes] if found.complete else [math.inf]

    def disk(self, skew: int = 1) -> Margin:
        """1/max |S + (skew - 1)/2| of a stable loop, S = 1/(1 + L); skew 1: least |1 + L|."""
        closed = self.L.num + self.L.den
        if closed.degree < self.L.den.degree:
            return Margin(0.0, math.inf)
        off = self.L.den + closed.scaled(Fraction(skew - 1, 2))
        if not off:  # L = 1 at all frequencies: the middle of the disk
            return NONE
        places = [] if closed.rational and off.rational else self._real_places
        near = [v for v in places if abs(self.L(1j * v)) < 1]
        most, v = largest(DelayedTransfer(off, closed), *near)
        return Margin(1.0 / most if most else math.inf, self.border.frequency(v))

    def unstable_poles(self, gain: float) -> float:
        """Poles of the loop with L times ``gain`` that are not stable."""
        found = zeros(self.L.num.scaled(Fraction(gain)) + self.L.den)
        return found.right + found.origin

    @property
    def static(self) -> float:
        """L at w = 0; nan where it is infinite."""
        below = self.L.den.taylor(0)
        return float(self.L.num.taylor(0) / below) if below else math.nan

    def known(self, factors: list[float]) -> float:
        """The factor on L up to which ``factors`` are all that move it to -1: with dead times there
        is no end of them."""
        finite = self.L.num.rational and self.L.den.rational
        return math.inf if finite else max(factors, default=math.inf)


@dataclass(frozen=True)
class StateLoop(Loop):
    """L = C (sI - A)^-1 B + D of many states, or L(z), in floating point."""

    L: StateSystem
    basis = " (in floating point)"

    def __post_init__(self) -> None:
        if self._through == -1:
            raise InputError(
                "L(s) is -1 as s grows, so that the closed loop L/(1 + L) is improper."
            )

    @property
    def _through(self) -> float:
        return float(self.L.D[0, 0])

    @property
    def border(self) -> Axis:
        return self.L.border

    @cached_property
    def sensitivity(self) -> StateSystem:
        """1/(1 + L)."""
        M, own = self.L, 1.0 / (1.0 + self._through)
        A = M.A - M.B @ M.C * own
        return StateSystem(A, M.B * own, -M.C * own, np.array([[own]]), self.border)

    @cached_property
    def counts(self) -> tuple[float, float, float]:
        """Turns about -1, and poles of L and of the closed loop that are not stable."""
        both = self.L, self.sensitivity
        mine, theirs = (int((one.beyond > one.rounding).sum()) for one in both)
        return mine - theirs, mine, theirs

    @property
    def cause(self) -> str:
        """Why the closed loop is not stable; "" where it is."""
        closed = self.sensitivity
        right = closed.beyond >= -closed.rounding
        if not right.any():
            return ""
        upper = [p for p in map(complex, closed.poles[right]) if p.imag >= 0]
        where = self.border.outside
        where += "" if self.counts[2] else " or, within rounding, on its border"
        return f"it has poles {where} ({show_poles(upper)}), found in floating point"

    @property
    def open_at_infinity(self) -> bool:
        return abs(self._through) >= 1

    @property
    def static(self) -> float:
        """L at w = 0; nan where it is infinite."""
        value, slack = self.L.at(0.0)
        return value.real if slack < abs(value) else math.nan

    def crossovers(self) -> list[tuple[float, complex]]:
        """Where |L| = 1, and L there."""

        def above(w: float) -> tuple[float, float]:
            t, slack = self.L.at(w)
            return abs(t) - 1.0, slack

        return self._changes(above, self.L.level_zeros(1.0))

    def real_crossings(self) -> list[tuple[float, float]]:
        """Where L is real and negative, and L there."""

        def part(w: float) -> tuple[float, float]:
            t, slack = self.L.at(w)
            return t.imag, slack

        found = [(w, L.real) for w, L in self._changes(part, self.L.mirrored_zeros(-1.0))]
        for v in (0.0, math.inf):
            value, slack = self.L.at(v)
            if abs(value) > slack:
                found.append((self.border.frequency(v), value.real))
        return [(w, x) for w, x in found if x < 0]

    def _changes(self, function: Any, zeros: np.ndarray) -> list[tuple[float, complex]]:
        edges = self.L.signs(function, self.L.places(zeros)).edges
        return [(self.border.frequency(e.at), self.L.at(e.at)[0]) for e in edges]

    def disk(self, skew: int = 1) -> Margin:
        """1/max |S + (skew - 1)/2| of a stable loop, S = 1/(1 + L); skew 1: least |1 + L|."""
        S = self.sensitivity
        most, w = S.plus(0.5 * (skew - 1)).largest()
        return Margin(1.0 / most if most else math.inf, w)

    def known(self, factors: list[float]) -> float:
        """The factor on L up to which ``factors`` are all that move it to -1: a beginning or an end
        of L that is 0 within rounding may be reached beyond it."""
        ends = [slack for value, slack in map(self.L.at, (0.0, math.inf)) if abs(value) <= slack]
        return min((1.0 / float(slack) for slack in ends if slack), default=math.inf)

    def unstable_poles(self, gain: float) -> float:
        """Poles of the loop with L times ``gain`` that are not stable."""
        M = replace(self.L, C=gain * self.L.C, D=gain * self.L.D)
        return StateLoop(M).counts[2] if M.D[0, 0] != -1 else math.nan


def _places(found: Signs) -> list[float]:
    return sorted({*found.changes, *found.touches})


def lag(value: complex) -> float:
    """The phase lag in rad, above 0 and up to 2 pi, that turns L(jw) to the negative real axis."""
    angle = math.atan2(-value.imag, -value.real)
    return angle if angle > 0 else angle + 2 * math.pi


def gain_margins(crossings: list[tuple[float, float]]) -> tuple[Margin, Margin]:
    """The nearest factors below and above 1 that put a pole on the axis."""
    factors = [Margin(-1.0 / x, w) for w, x in crossings]
    below = max((m for m in factors if m.value < 1), default=Margin(0.0))
    return below, min((m for m in factors if m.value >= 1), default=NONE)


def _between(low: float, high: float) -> float:
    if math.isinf(high):
        return 2.0 * low or 1.0
    return math.sqrt(low * high) or 0.5 * high


def nearest(below: Margin, above: Margin) -> Margin:
    """The gain margin that is nearer to 1 in dB."""
    if not below.value or above.value <= 1.0 / below.value:
        return above
    return below
