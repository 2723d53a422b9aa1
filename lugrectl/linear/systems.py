"""What a check is asked about: a system with exact coefficients, of many states, or measured.

Exact are T(s), also with dead times, and T(z), each of one input and one output.

How real a rational T is, is decided on rational numbers. Of T(s) with dead times the sign of
Re T(jw) and the zeros of its denominator are decided in floating point (:mod:`axis`); of T(z) the
circle is closed, so that there is no WSPR.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from .axis import Signs, extreme, largest, level_signs, reach, settled, signs, zeros
from .border import Axis, border_of, says_hidden
from .delayed import DelayedTransfer, reduced
from .exact import (
    Poly,
    Quasi,
    add,
    axis_roots,
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
from .state_system import StateSystem, last_that_holds
from .transfer import (
    along,
    coefficients,
    crossings,
    is_measured,
    require_siso,
    response,
    span,
    to_float,
)
from .verdict import Falls, NoGain, Realness

NEAR_ZERO = 1e-12
EXACT = 6  # states of a state-space model that is decided in exact arithmetic
LEAST = 1e-300
BEYOND = "on whether T is stable, it says nothing"
TURNS = 3e4  # rad of phase of a dead time up to which a shifted function is followed


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

    @property
    def axis(self) -> DelayedTransfer:
        """T in the variable whose imaginary axis the frequencies lie on."""
        return DelayedTransfer(self.num, self.den)

    def on_axis(self, q: Quasi) -> Quasi:
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
        found = level_signs(self.axis, power * (top / bottom) ** 2).changes
        at = tuple(map(self.border.frequency, found))
        return Falls(abs(float(top / bottom)), at, min(at, default=math.inf))

    def no_gain(self) -> NoGain | None:
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
        gain, v = largest(self.axis)
        return gain, self.border.frequency(v)

    def realness(self) -> Realness:
        real = self.num.real_product(self.den)
        found = signs(real)
        kind, why = "not PR", _why_not(self, found)
        if not why:
            kind, why = _how_real(self, real, found)
        why += _rounding(self) + (f"; {self.hidden}" if self.hidden else "")
        return Realness(kind, why, self._edge(real, found), _margin(self) if kind == "SPR" else 0.0)

    def _edge(self, real: Quasi, found: Signs) -> float:
        """End of the band (0+, edge) with Re T > 0, in rad/s; inf if it reaches half the rate."""
        if not self.rational:
            first = [*found.changes[:1], *found.touches[:1]] if found.first > 0 else [0.0]
            return min(first, default=math.inf)
        v = band_edge(*self.ratio)
        ends = math.isfinite(v) or real.degree < 2 * self.den.degree
        return self.border.frequency(v) if ends else v


# --- why T is not positive real ------------------------------------------------------------


def _why_not(T: ExactSystem, found: Signs) -> str:
    """Why T is not positive real; empty where it is."""
    if not T.given.num:
        return ""
    if T.border.dt and T.excess < 0:
        ahead = f"{-T.excess} sample{'s' * (T.excess < -1)}"
        return f"T(z) is improper: its output would need the input {ahead} ahead"
    if T.rational:
        if not T.stable and T.border.has_outside(T.given.den.polynomial):
            return f"T has poles {T.border.outside} ({T.seen})"
    else:
        right, _, on_axis = zeros(T.den)
        if right or on_axis is not None:
            return f"T has {T.seen}"
    causes = []
    if found.first < 0 or found.changes:
        causes.append(f"{T.border.real} < 0 {_bands(T, found)}")
    if T.border.dt and T.excess > 0:
        causes.append(
            f"T has a delay of {T.excess} sample{'s' * (T.excess > 1)}: without a direct part, "
            "T(z) -> 0 as z grows, no T(z) is positive real"
        )
    elif not T.border.dt and abs(T.excess) > 1:
        causes.append(f"the relative degree is {T.excess}, which must be -1, 0 or 1")
    elif causes and T.rational and not T.border.dt:
        causes.append(_limit(T))
    return "; ".join([*causes, *_poles_on_border(T, bool(causes))])


def _poles_on_border(T: ExactSystem, more: bool) -> list[str]:
    """What is wrong with poles on the border; of a rational T, if nothing else is (``more``)."""
    if T.rational:
        if more or hurwitz(add(*T.ratio)):
            return []
        where = [f"w = {w:.6g} rad/s" if math.isfinite(w) else "infinity" for w in _on_border(T)]
        return [
            f"a pole {T.border.on} is repeated or its residue is not positive (poles at "
            f"{', '.join(where)})"
        ]
    said, origin = [], T.den.order()
    top, bottom = T.num.leading, T.den.leading
    if T.excess == -1 and not ({*top, *bottom} == {0} and top[0] / bottom[0] > 0):
        said.append("T grows with w, and not as s times a positive number")
    if origin > 1 or (origin and T.num.taylor(0) / T.den.taylor(1) < 0):
        said.append("the pole at s = 0 is repeated or its residue is not positive")
    return said


def _on_border(T: ExactSystem) -> list[float]:
    """The frequencies of poles on the border; inf: T(s) grows with s."""
    num, den = T.ratio
    at = [*axis_roots(den)[0], *[math.inf] * (len(num) > len(den))]
    return [T.border.frequency(v) for v in at]


def _bands(T: ExactSystem, found: Signs) -> str:
    """The bands in which Re T < 0, in words; with dead times the first of them."""
    ends = [T.border.frequency(v) for v in ([0.0] * (found.first < 0)) + [*found.changes]]
    pairs = list(pairwise([*ends, T.border.frequency(math.inf)]))[0::2]

    def band(low: float, high: float) -> str:
        if math.isfinite(high):
            return f"for {low:.6g} < w < {high:.6g} rad/s" if low else f"for w < {high:.6g} rad/s"
        return f"for w > {low:.6g} rad/s" if low else "at every w"

    shown = [band(*pair) for pair in (pairs if T.rational else pairs[:2])]
    if not found.complete:
        return f"first {shown[0]}, and again and again as w grows: the dead time turns the phase"
    more = len(pairs) - len(shown)
    return " and ".join(shown) + (f" and at {more} higher places" if more else "")


# --- how real a positive real T is ---------------------------------------------------------


def _how_real(T: ExactSystem, real: Quasi, found: Signs) -> tuple[str, str]:
    """The kind of a positive real T, and why."""
    name, closed = T.border.real, T.border.dt is not None
    if not real:
        return "PR", f"T is lossless, {name} = 0 at every w" if T.given.num else "T is zero"
    at = [0.0] * bool(T.den.order())
    if T.rational:  # one at infinity of T(s) apart
        at = [] if T.stable else [w for w in _on_border(T) if math.isfinite(w)]
    if at:
        where = ", ".join(f"{w:.6g}" for w in at)
        return "PR", f"simple poles with positive residues {T.border.on} at w = {where} rad/s"
    falls_off = real.degree < 2 * min(T.num.degree, T.den.degree)
    if not closed and not real.taylor(0):
        return "PR", f"{name} >= 0, but T has a zero at s = 0"
    ends = [0.0] * (not real.taylor(0)), [math.inf] * (closed and real.degree < 2 * T.degree)
    if zeros_at := [*ends[0], *found.touches, *ends[1]]:
        where = ", ".join(f"{T.border.frequency(v):.6g}" for v in zeros_at)
        return "PR", f"{name} >= 0, but it is 0 at w = {where} rad/s"
    if falls_off:
        return "WSPR", f"{name} > 0 at every finite w, but {_limit(T)}"
    where = T.border.least_stable(T.poles[0]) if T.poles else "no poles"
    where = where if T.rational else "all poles are left of the axis"
    if closed:
        value, v = extreme(real_product(*T.ratio), real_product(T.ratio[1], T.ratio[1]), -1)
        end = f", the least {value:.6g} at w = {T.border.frequency(v):.6g} rad/s"
    else:
        end = f" and {_limit(T)}"
    return "SPR", f"{where}, {name} > 0 at every w{end}"


def _limit(T: ExactSystem) -> str:
    """The high-frequency limit of Re T(jw) in words."""
    name = "w^2 Re T(jw)" if T.excess > 0 else "Re T(jw)"
    num, den = T.ratio
    if not T.rational:
        strict = T.num.real_product(T.den).degree == 2 * min(T.num.degree, T.den.degree)
        return f"{name} {'stays above 0' if strict else 'tends to 0'} as w grows"
    real, full = real_product(num, den), min(len(num), len(den))
    value = Fraction(real[full - 1]) / den[-1] ** 2 if len(real) >= full else 0
    return f"{name} tends to {float(value):.6g} as w grows"


def _rounding(T: ExactSystem) -> str:
    """A remark if a coefficient of P is only the rounding error of its terms."""
    if not T.rational or T.border.dt:
        return ""
    real = real_product(*T.ratio)
    terms = real_product(
        *(tuple(abs(c) * (-1) ** (i // 2) for i, c in enumerate(p)) for p in T.ratio)
    )
    near = [float(abs(Fraction(c)) / t) for c, t in zip(real, terms, strict=False) if c]
    if not near or min(near) > NEAR_ZERO:
        return ""
    return (
        f"; a coefficient of P differs from 0 by only {min(near):.1e} of its terms, so the "
        "rounding of the inputs decides"
    )


# --- the margin ----------------------------------------------------------------------------


def _margin(T: ExactSystem) -> float:
    """The largest eps in 1/s with T(s - eps), or T(exp(-eps dt) z), positive real, of an SPR T."""
    if not T.rational:
        return _delayed_margin(T)
    if T.border.dt is None:
        return margin(*T.ratio)
    if not T.degree:
        return math.inf
    given = [q.polynomial for q in (T.given.num, T.given.den)]

    def holds(less: Fraction) -> bool:
        inner = (tuple(c * (1 - less) ** i for i, c in enumerate(a)) for a in given)
        return positive_real(*(T.border.mapped(a, T.degree) for a in inner))

    return -math.log1p(-float(_last(holds, Fraction(1)))) / T.border.dt


def _delayed_margin(T: ExactSystem) -> float:
    delay = max(T.given.dead_times)
    most = max(TURNS / delay, 10.0 * (reach(T.den) or 0.0))

    def holds(eps: float) -> bool:
        moved = replace(T, given=DelayedTransfer(T.num.shifted(eps), T.den.shifted(eps)))
        real = moved.num.real_product(moved.den)
        if (reach(moved.den) or math.inf) > most:
            return False  # short of a chain of poles: eps is too large, or so by about 1e-4
        try:
            return settled(real) is not None and not _why_not(moved, signs(real))
        except InputError:
            return False

    high = 1.0 / delay
    while holds(high):
        high *= 2.0
    return last_that_holds(holds, high)


# --- num/den in lowest terms ---------------------------------------------------------------


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

    def holds(eps: Fraction) -> bool:
        return positive_real(shift(num, eps), shift(den, eps))

    nearest = min(means)
    if holds(nearest):
        return to_float(nearest)
    bits = nearest.numerator.bit_length() - nearest.denominator.bit_length()
    return to_float(_last(holds, 2 * Fraction(2) ** bits))


def _last(holds: Callable[[Fraction], bool], high: Fraction) -> Fraction:
    """The largest value below ``high`` for which it holds, as for all smaller ones; bisection."""
    low = high / 2
    while not holds(low):
        low /= 2
    steps = range(1, 2**50)
    k = bisect_left(steps, True, key=lambda k: not holds(low + low * Fraction(k, 2**50)))
    return low + low * Fraction(k, 2**50)


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


@dataclass(frozen=True)
class MeasuredSystem:
    """T(jw) at frequencies w in rad/s."""

    w: np.ndarray
    values: np.ndarray
    border, stable, poles, seen, hidden, size = Axis(), True, (), "", "", "|T|"
    meaning = "the L2 gain is at least {:.6g}"

    @property
    def said(self) -> str:
        """What the largest value rests on."""
        return f", of {span(self.w)}; between and outside them, and {BEYOND}"

    def no_gain(self) -> None:
        """Why there is no L2 gain."""

    def largest(self) -> tuple[float, float]:
        k = int(np.argmax(np.abs(self.values)))
        return float(abs(self.values[k])), float(self.w[k])

    def falls(self, power: Fraction) -> Falls:
        """Where |T|^2, linear in dB over log w, crosses ``power`` times its first value."""
        w, size = self.w, np.abs(self.values)
        if size[0] == 0:
            return Falls(0.0, base=f"|T| at the lowest frequency, {w[0]:.6g} rad/s,")
        said = f", relative to |T| = {size[0]:.6g} at the lowest frequency, of {span(w)}; on lower"
        said += f" frequencies, and {BEYOND}"
        above = 20 * np.log10(np.maximum(size, LEAST) / size[0]) - 10 * math.log10(power)
        found = tuple(along(w, k, part) for k, part in crossings(above))
        return Falls(float(size[0]), found, min(found, default=math.inf), said, "")

    def realness(self) -> Realness:
        w, real = self.w, np.real(self.values)
        if (real < 0).any():
            ends = np.flatnonzero(np.diff([0, *(real < 0), 0])).reshape(-1, 2)
            bands = [f"from {w[k]:.6g} to {w[end - 1]:.6g} rad/s" for k, end in ends]
            reason = f"Re T(jw) < 0 {' and '.join(bands)}, of {span(w)}"
            return Realness("not PR", reason, _edge(w, real), math.nan)
        kind, sign = ("SPR", ">") if (real > 0).all() else ("PR", ">=")
        k = int(np.argmin(real))
        reason = (
            f"Re T(jw) {sign} 0 at all of {span(w)}; the least value is {real[k]:.4g} at "
            f"{w[k]:.6g} rad/s; outside them, and {BEYOND}"
        )
        return Realness(kind, reason, _edge(w, real), math.nan)


def _edge(w: np.ndarray, real: np.ndarray) -> float:
    """Where Re T, linear in log w between the measured frequencies, first reaches 0."""
    if real[0] <= 0:
        return 0.0
    return next((along(w, k, part) for k, part in crossings(-real)), float(w[-1]))


System = ExactSystem | StateSystem | MeasuredSystem


def has_many_states(T: Any) -> bool:
    return isinstance(T, ct.StateSpace) and T.nstates > EXACT


def system_of(T: Any) -> System:
    """Return T of one input and output; InputError for what the checks do not take."""
    if is_measured(T):
        return MeasuredSystem(*response(T))
    if not has_many_states(T):
        return ExactSystem.of(T)
    require_siso(T, "T")
    return StateSystem.of(T).shown()
