"""Systems with exact coefficients, T(s), also with dead times, and T(z); and measured ones.

How real a rational T is, is decided on rational numbers. Of T(s) with dead times the sign of
Re T(jw) and the zeros of its denominator are decided in floating point (:mod:`axis`); of T(z) the
circle is closed, so that there is no WSPR. Between two frequencies of a measured response log |T|
and the phase are straight lines over log w (over w from w = 0).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from .axis import WINDOWS, largest, limits, reach, settled, signs, signs_in_x, zeros
from .border import Border, border_of
from .delayed import DelayedTransfer, reduced
from .exact import (
    Poly,
    Quasi,
    axis_roots,
    divide,
    gcd,
    hurwitz,
    positive_real,
    real_product,
    shift,
)
from .state_system import StateSystem
from .system import BITS, FEWER, Signs, System, last, why_not
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
from .verdict import Margin

NEAR_ZERO = 1e-12
EXACT = 6  # states of a state-space model that is decided in exact arithmetic
TURNS = 3e4  # rad of phase of a dead time up to which a shifted function is followed
FAR = 1e100  # rad/s: no crossing is looked for beyond it, where powers of w overflow
LEAST = 1e-300
BETWEEN, ZOOMS = 32, 8  # points between two frequencies, and times that they close up
CLOSE = 1e-3  # of |L| as w grows, where that is above 1: no factor on L is stable beyond it
SAME = 1e-9  # of |L|: a crossing that is lower by less is not looked for at higher frequencies


@dataclass(frozen=True)
class ExactSystem(System):
    """T(s), or T(z) as a function of v; ``given`` is T in its own variable."""

    given: DelayedTransfer
    border: Border = Border()

    @classmethod
    def of(cls, T: Any, name: str = "T") -> ExactSystem:
        """Raises InputError, which calls T ``name``, for anything else than the checks take."""
        if isinstance(T, DelayedTransfer):
            return cls(T)
        if isinstance(T, ct.TransferFunction | ct.StateSpace):
            require_siso(T, name)
        num, den = (Quasi.of([(0, p)]) for p in coefficients(T, name))
        return cls(reduced(num, den), border_of(T))

    # --- T in the variable whose imaginary axis the frequencies lie on ---

    @cached_property
    def T(self) -> DelayedTransfer:
        if self.border.dt is None:
            return self.given
        num, den = (
            Quasi.of([(0, self.border.mapped(q.polynomial, self.degree))])
            for q in (self.given.num, self.given.den)
        )
        return DelayedTransfer(num, den)

    @property
    def degree(self) -> int:
        return max(self.given.num.degree, self.given.den.degree)

    @property
    def excess(self) -> int:
        return self.given.den.degree - self.given.num.degree

    @cached_property
    def rational(self) -> bool:
        return self.given.num.rational and self.given.den.rational

    @cached_property
    def ratio(self) -> tuple[Poly, Poly]:
        return self.T.num.polynomial, self.T.den.polynomial

    # --- poles ---

    @cached_property
    def poles(self) -> tuple[complex, ...]:
        """Of a rational T (floats: for display, not for decisions)."""
        return self.border.roots(self.given.den.polynomial) if self.rational else ()

    @property
    def stable(self) -> bool:
        return not self.trouble

    @cached_property
    def _zeros(self) -> Any:
        return zeros(self.T.den)

    @property
    def right(self) -> float:
        return self._zeros.right

    @cached_property
    def trouble(self) -> str:
        if self.border.dt and self.border.stable(self.given.den.polynomial):
            return ""
        right, origin, on_axis = self._zeros
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

    @property
    def seen(self) -> str:
        return self.border.show(self.poles) if self.rational else self.trouble

    @property
    def hidden(self) -> str:
        return self.border.hidden(self.given.cancelled)

    @property
    def lost(self) -> bool:
        return self.border.has_outside(self.given.cancelled)

    # --- values and signs ---

    def dc(self) -> tuple[Any, float]:
        top, bottom = self.T.num.taylor(0), self.T.den.taylor(0)
        return (abs(top / bottom) if bottom else math.inf) if top else 0, 0.0

    def at(self, v: float) -> tuple[complex, float]:
        return self.T(1j * v), 0.0

    def signs(self, part: str, level: Any = 0, doubt: float = 0.0) -> Signs:
        num, den = self.T.num, self.T.den
        if part == "size":
            found = signs(num.squared() + den.squared().scaled(-Fraction(level)))
        elif part == "imag":
            found = self._imaginary()
        else:
            found = self._with_ends(signs(num.real_product(den)))
        return found.moved(self.border.frequency)

    def _with_ends(self, found: Signs) -> Signs:
        """The signs of Re T with its zeros at w = 0 and half the rate; a pole on the axis at which
        Re T is finite is no zero of it."""
        real = self.T.num.real_product(self.T.den)
        if not real:
            return found
        at_0, ends = not (real.taylor(0) or self.T.den.order()), []
        if self.rational:
            P, square = (real_product(p, self.ratio[1]) for p in self.ratio)
            common = gcd(P, square)
            if len(common) > 1:
                P, square = divide(P, common)[0], divide(square, common)[0]
                found = found._replace(touches=signs_in_x(P).touches)
            at_0 = P[0] == 0
            ends = [math.inf] * (self.border.dt is not None and len(P) < len(square))
        more = Signs.exact(1, (), [*[0.0] * at_0, *(e.at for e in found.touches), *ends])
        return found._replace(touches=more.touches)

    def _imaginary(self) -> Signs:
        """The signs of Im T; with a dead time, which makes them change at ever higher frequencies,
        up to beyond the largest |T| below 1 and every |T| above 1 where T is real and negative."""
        T = self.T
        product = T.num * T.den.mirror()
        odd = product + product.mirror().scaled(-1)
        turned = Quasi.of([(0, (0, 1))]) * odd  # s (N(s) D(-s) - N(-s) D(s)), even
        if not turned or turned.rational or settled(turned) is not None:
            return signs(turned)
        least = max([1.0, *(abs(x) * (1 + CLOSE) for x in limits(T))])
        end = max([1.0 / max(T.dead_times), *filter(math.isfinite, self._level(least))])
        found = Signs(1)
        for _ in range(1 if self.open_at_infinity else WINDOWS):
            if end > FAR:
                break
            found = signs(turned, end)
            below = [-x for v in found.places if -1 < (x := T(1j * v).real) < 0]
            beyond = self._level(max(below) * (1 - SAME)) if below else [math.inf]
            if max(beyond, default=0.0) <= end:
                break
            end = max([2.0 * end, *(1.01 * v for v in beyond if math.isfinite(v))])
        return found

    def _level(self, size: float) -> list[float]:
        """Where |T(jv)| = size."""
        square = self.T.num.squared() + self.T.den.squared().scaled(-(Fraction(size) ** 2))
        try:
            found = signs(square)
        except (InputError, OverflowError):  # |T| has this size again and again, or too far out
            return [math.inf]
        return [*found.changes] if found.complete else [math.inf]

    def largest(self) -> tuple[float, float]:
        gain, v = largest(self.T)
        return gain, self.border.frequency(v)

    # --- realness ---

    @property
    def zero(self) -> bool:
        return not self.given.num

    @property
    def outside(self) -> str:
        if not self.rational:
            found = self._zeros
            return self.trouble if found.right or found.on_axis is not None else ""
        bad = not self.stable and self.border.has_outside(self.given.den.polynomial)
        return f"poles {self.border.outside} ({self.seen})" if bad else ""

    @property
    def on_border(self) -> str:
        if self.stable:
            return ""
        where = axis_roots(self.ratio[1])[0] if self.rational else [0.0]
        if self.border.dt and len(self.ratio[1]) <= self.degree:
            where = [*where, math.inf]
        shown = ", ".join(f"{self.border.frequency(v):.6g}" for v in where)
        return f"{self.border.on} at w = {shown} rad/s"

    @property
    def strange(self) -> list[str]:
        allowed = "-1, 0 or 1" if self.border.dt is None else "0 in z: no delay, no sample ahead"
        if self.zero or abs(self.excess) <= (self.border.dt is None):
            return []
        return [f"the relative degree is {self.excess}, which must be {allowed}"]

    @property
    def fits(self) -> bool:
        total = self.T.num + self.T.den
        return hurwitz(total.polynomial) if self.rational else zeros(total) == (0, 0, None)

    @cached_property
    def limit(self) -> tuple[int, str]:
        num, den = self.T.num, self.T.den
        if self.border.dt:
            return 1, ""
        real, full = num.real_product(den), 2 * min(num.degree, den.degree)
        name = "w^2 Re T(jw)" if self.excess > 0 else "Re T(jw)"
        there = real.degree >= full
        if not self.rational:
            return int(there), f"{name} {'stays above 0' if there else 'tends to 0'} as w grows"
        value = Fraction(0)
        if there:
            value = Fraction(real_product(*self.ratio)[full // 2]) / den.polynomial[-1] ** 2
        said = f"{name} tends to {to_float(value):.6g} as w grows"
        return int(value > 0) - int(value < 0), said

    @property
    def least_stable(self) -> str:
        if not self.rational:
            return "all poles are left of the axis"
        return self.border.least_stable(self.poles[0]) if self.poles else "no poles"

    @property
    def remark(self) -> str:
        """On a coefficient of P that is only the rounding error of its terms."""
        if not self.rational or self.border.dt:
            return ""
        sizes = (tuple(abs(c) * (-1) ** (i // 2) for i, c in enumerate(p)) for p in self.ratio)
        real, terms = real_product(*self.ratio), real_product(*sizes)
        near = [float(abs(Fraction(c)) / t) for c, t in zip(real, terms, strict=False) if c]
        if not near or min(near) > NEAR_ZERO:
            return ""
        return (
            f"; a coefficient of P differs from 0 by only {min(near):.1e} of its terms, so the "
            "rounding of the inputs decides"
        )

    def _is_real(self, less: Fraction) -> bool:
        """Whether T(s - less), or T((1 - less) z), is positive real."""
        T = self.T
        if self.rational and self.border.dt is None:
            return positive_real(*(shift(p, less) for p in self.ratio))
        if self.rational:
            both = (self.given.num.polynomial, self.given.den.polynomial)
            inner = (tuple(c * (1 - less) ** i for i, c in enumerate(p)) for p in both)
            return positive_real(*(self.border.mapped(p, self.degree) for p in inner))
        moved = replace(self, given=DelayedTransfer(T.num.shifted(less), T.den.shifted(less)))
        if (reach(moved.T.den) or math.inf) > max(
            TURNS / max(T.dead_times), 10.0 * (reach(T.den) or 0.0)
        ):
            return False  # short of a chain of poles: eps is too large, or so by about 1e-4
        try:
            known = settled(moved.T.num.real_product(moved.T.den)) is not None
            return known and why_not(moved, moved.signs("real")) == ""
        except InputError:
            return False

    def margin(self) -> float:
        if not self.degree and self.rational:
            return math.inf
        if self.border.dt:
            high = 1 - Fraction(1, 2**60)
        elif self.rational:
            # Poles and zeros must stay left of the axis; the nearest one is not farther than
            # their mean.
            high = min(Fraction(p[-2]) / p[-1] / (len(p) - 1) for p in self.ratio if len(p) > 1)
        else:
            high = 1 / Fraction(max(self.given.dead_times))
            while self._is_real(high):
                high *= 2
        found = last(self._is_real, high, BITS if self.rational else FEWER)
        return self.border.rate(to_float(found))

    # --- the loop closed over T ---

    @property
    def open_at_infinity(self) -> bool:
        num, den = self.T.num, self.T.den
        if num.degree != den.degree:
            return num.degree > den.degree
        low = den.leading
        own = abs(low.pop(0, Fraction(0))) - sum(map(abs, low.values()))
        return own <= 0 or sum(map(abs, num.leading.values())) >= own

    def ends(self) -> list[tuple[float, float]]:
        below = self.T.den.taylor(0)
        static = [(0.0, float(self.T.num.taylor(0) / below))] if below else []
        return [*static, *((self.border.frequency(math.inf), x) for x in limits(self.T))]

    def known(self, factors: list[float]) -> float:
        """With dead times there is no end of them."""
        return math.inf if self.rational else max(factors, default=math.inf)

    def closed(self, gain: float = 1.0) -> ExactSystem:
        num, den = self.given.num.scaled(Fraction(gain)), self.given.den
        if not (total := num + den):
            raise InputError("L(s) is -1, so that the closed loop L/(1 + L) has no solution.")
        return ExactSystem(DelayedTransfer(den, total, self.given.cancelled), self.border)

    def plus(self, c: float) -> ExactSystem:
        made = DelayedTransfer(self.given.num + self.given.den.scaled(Fraction(c)), self.given.den)
        return replace(self, given=made)


@dataclass(frozen=True)
class MeasuredSystem(System):
    """T(jw) at frequencies w in rad/s; ``right``: its poles right of the axis, as declared."""

    w: np.ndarray
    values: np.ndarray
    right: float = 0
    meaning, base = "the L2 gain is at least {:.6g}", "T at the lowest frequency"
    alike, no_margin = 0.02, math.nan

    @property
    def basis(self) -> str:
        return (
            f", of {span(self.w)}; between and outside them, and on whether T is stable, it says "
            "nothing"
        )

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """log |T| and the phase in rad."""
        return np.log(np.maximum(np.abs(self.values), LEAST)), np.unwrap(np.angle(self.values))

    def value(self, k: int, x: float) -> complex:
        """T a part x of the way from point k to the next."""
        size, turned = (float(line[k] + x * (line[k + 1] - line[k])) for line in self.lines)
        return cmath.rect(math.exp(size), turned)

    def dc(self) -> tuple[Any, float]:
        return float(abs(self.values[0])), 0.0

    def at(self, v: float) -> tuple[complex, float]:
        k = min(max(int(np.searchsorted(self.w, v, "right")) - 1, 0), len(self.w) - 2)
        low, high = self.w[k : k + 2].tolist()
        x = math.log(v / low) / math.log(high / low) if low else v / high
        return self.value(k, x), 0.0

    def signs(self, part: str, level: Any = 0, doubt: float = 0.0) -> Signs:
        """Of Im T those of the changes at which T is real and negative."""
        w, size = self.w, self.lines[0]
        if part == "imag":
            return Signs.exact(1, sorted(along(w, k, x) for k, x in self.half_turns()))
        line = size - 0.5 * math.log(level) if part == "size" else np.real(self.values)
        edges = [along(w, k, x) for k, x in crossings(line)]
        touches = w[line == 0].tolist() if part == "real" else ()
        return Signs.exact(-1 if line[0] < 0 else 1, edges, touches)._replace(end=float(w[-1]))

    def half_turns(self) -> list[tuple[int, float]]:
        """Where the phase goes through an odd multiple of 180 deg."""
        turned = self.lines[1]
        low, high = (math.floor((x / math.pi - 1) / 2) for x in (turned.min(), turned.max()))
        halves = [(2 * m + 1) * math.pi for m in range(low, high + 2)]
        return [place for half in halves for place in crossings(turned, half)]

    def largest(self) -> tuple[float, float]:
        k = int(np.argmax(np.abs(self.values)))
        return float(abs(self.values[k])), float(self.w[k])

    # --- the loop closed over T ---

    @property
    def beyond_band(self) -> Margin:
        """The factor on T up to which the last |T| stays below 1."""
        size = float(abs(self.values[-1]))
        return Margin(1.0 / size if size else math.inf, float(self.w[-1]))

    @property
    def integrators(self) -> int:
        """How many the slope at the lowest frequency shows."""
        if not self.w[0]:
            return 0
        size = self.lines[0]
        return max(round(float((size[0] - size[1]) / math.log(self.w[1] / self.w[0]))), 0)

    def ends(self) -> list[tuple[float, float]]:
        first = self.values[0]
        return [] if self.integrators else [(0.0, math.copysign(abs(first), first.real))]

    def known(self, factors: list[float]) -> float:
        """Beyond the band |T| may be as large as at its end."""
        return self.beyond_band.value

    def closed(self, gain: float = 1.0) -> MeasuredLoop:
        return MeasuredLoop(replace(self, values=gain * self.values))


@dataclass(frozen=True)
class MeasuredLoop(System):
    """c + 1/(1 + L) of a measured L, stable by Nyquist's criterion."""

    L: MeasuredSystem
    c: float = 0.0

    @property
    def basis(self) -> str:
        held = f"{self.L.right or 'no'} pole{'s' * (self.L.right != 1)}"
        return (
            f", of {span(self.L.w)}, if L has {held} right of the axis and no crossover beyond them"
        )

    @cached_property
    def right(self) -> float:
        """Nan where |L| ends above 1."""
        L, n = self.L, self.L.integrators
        first, (_, turned) = complex(L.values[0]), L.lines
        if abs(L.values[-1]) >= 1:
            return math.nan
        # From w = 0 the short way to the first point; at the last, 1 + L goes the short way to 1.
        along_0 = (-1j) ** n
        sign = 1 if (first / along_0).real >= 0 else -1
        late = along_0 * sign if n else complex(1 + sign * abs(first))
        angle = cmath.phase((1 + first) / late) - cmath.phase(1 + first)
        for k, x in L.half_turns():
            if L.value(k, x).real < -1:
                angle += math.copysign(2 * math.pi, turned[k + 1] - turned[k])
        return round(L.right + n / 2 - angle / math.pi)

    @property
    def trouble(self) -> str:
        if not self.right:
            return ""
        if math.isnan(self.right):
            return (
                "any number of poles: this is not decided, |L| is "
                f"{abs(self.L.values[-1]):.4g} at the highest frequency and must be below 1; "
                "measure up to higher ones"
            )
        many = f"{self.right:.0f} pole{'s' * (self.right != 1)}"
        return f"{many} right of the imaginary axis{self.basis}"

    def plus(self, c: float) -> MeasuredLoop:
        return replace(self, c=self.c + c)

    def largest(self) -> tuple[float, float]:
        """Of points between all frequencies, and again about the largest."""

        def at(k: Any, x: Any) -> Any:
            size, turned = (line[k] + x * (line[k + 1] - line[k]) for line in self.L.lines)
            with np.errstate(divide="ignore"):
                return np.abs(self.c + 1 / (1 + np.exp(size + 1j * turned)))

        x = np.linspace(0.0, 1.0, BETWEEN + 1)
        every = at(np.arange(len(self.L.w) - 1)[:, None], x)
        k, i = divmod(int(np.argmax(every)), BETWEEN + 1)
        part, width = x[i], 1.0 / BETWEEN
        for _ in range(ZOOMS):
            x = np.clip(part + width * np.linspace(-1.0, 1.0, BETWEEN + 1), 0.0, 1.0)
            part, width = x[np.argmax(at(k, x))], 2.0 * width / BETWEEN
        return max((float(at(k, part)), along(self.L.w, k, part)), (abs(self.c + 1.0), math.inf))


def system_of(T: Any) -> Any:
    """T of one input and output; InputError for what the checks do not take."""
    if is_measured(T):
        return MeasuredSystem(*response(T))
    if not has_many_states(T):
        return ExactSystem.of(T)
    require_siso(T, "T")
    return StateSystem.of(T).shown()


def has_many_states(T: Any) -> bool:
    return isinstance(T, ct.StateSpace) and T.nstates > EXACT
