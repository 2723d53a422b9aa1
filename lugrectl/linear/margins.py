"""How far a stable loop is from -1: gain, phase, modulus and delay margin.

Nothing is read off a grid. |L| = 1, Im L = 0 and the peak of |1/(1 + L)| are conditions on
(quasi-)polynomials on the imaginary axis, whose changes of sign ``axis.signs`` isolates; a sampled
loop is mapped there by z = (1 + v)/(1 - v).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

from ..core.errors import InputError
from . import peaks
from .axis import WINDOWS, Signs, settled, signs, zeros
from .delayed import DelayedTransfer
from .delayed_checks import largest, limits, square
from .quasi import Quasi

FAR = 1e100  # rad/s: no crossing is looked for beyond it, where powers of w overflow
SAME = 1e-9  # of |L|: a crossing that is lower by less is not looked for at higher frequencies


class Margin(NamedTuple):
    """A margin, and its frequency in rad/s (nan where there is none)."""

    value: float = math.inf
    at: float = math.nan


NONE, UNKNOWN = Margin(), Margin(math.nan)


@dataclass(frozen=True)
class Loop:
    """L(s), or L(z) as a function of v, and its place on the axis at a frequency."""

    L: DelayedTransfer
    dt: float | None = None

    def frequency(self, v: float) -> float:
        """w in rad/s of the place jv."""
        return v if self.dt is None else 2.0 * math.atan(v) / self.dt

    def crossovers(self) -> list[tuple[float, complex]]:
        """Where |L| = 1, crossing or touching: w in rad/s and L there."""
        above = square(self.L.num) + square(self.L.den).scaled(-1)
        return [(self.frequency(v), self.L(1j * v)) for v in _places(signs(above))]

    def real_crossings(self) -> list[tuple[float, float]]:
        """Where L is real and negative: w in rad/s and L there.

        A dead time makes it so at ever higher frequencies; those with the largest |L| below 1 and
        with every |L| above 1 are among them.
        """
        found = [(v, self.L(1j * v).real) for v in self._real_places]
        if self.L.den.taylor(0):
            found.append((0.0, float(self.L.num.taylor(0) / self.L.den.taylor(0))))
        found += [(math.inf, x) for x in limits(self.L)]
        return [(self.frequency(v), x) for v, x in found if -math.inf < x < 0]

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
            found = signs(square(self.L.num) + square(self.L.den).scaled(-(Fraction(size) ** 2)))
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
        if closed.rational and off.rational:
            most, v = peaks.largest(off.polynomial, closed.polynomial)
        else:
            near = [v for v in self._real_places if abs(self.L(1j * v)) < 1]
            most, v = largest(DelayedTransfer(off, closed), *near)
        return Margin(1.0 / most if most else math.inf, self.frequency(v))

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


def stable_gains(
    loop: Any, crossings: list[tuple[float, float]]
) -> tuple[tuple[float, float], ...]:
    """The intervals of a factor on L, above 0, with which the closed loop is stable.

    Poles reach the axis only at factors that move L to -1: one point of each interval decides. None
    is claimed beyond the largest factor up to which these are known.
    """
    factors = sorted({-1.0 / x for _, x in crossings})
    most = loop.known(factors)
    borders = [0.0, *(x for x in factors if x < most), most]
    return tuple(
        (low, high)
        for low, high in pairwise(borders)
        if loop.unstable_poles(_between(low, high)) == 0
    )


def _between(low: float, high: float) -> float:
    if math.isinf(high):
        return 2.0 * low or 1.0
    return math.sqrt(low * high) or 0.5 * high


def nearest(below: Margin, above: Margin) -> Margin:
    """The gain margin that is nearer to 1 in dB."""
    if not below.value or above.value <= 1.0 / below.value:
        return above
    return below
