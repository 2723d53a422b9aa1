"""What every check asks of a system, and the signs of a function along the axis.

A check is ``of(T)``: a system; signs of Re T, Im T or |T|^2 along the axis, and numbers; a verdict.
There are systems with exact coefficients, of many states in floating point, and measured ones.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from .border import Border
from .verdict import NONE, Margin, Realness

SHARP = 1e-6  # relative distance of the two sides of an edge that counts as none
NEAREST, FURTHER = 1e-13, 2.0  # of an edge: the first point beside it, and the next ones
SHOWN = 2  # bands below 0 that are named
BITS, FEWER = 42, 30  # of a limit that is bisected, in exact arithmetic and in floating point
Function = Callable[[float], tuple[float, float]]  # value and rounding bound at a frequency


class Edge(NamedTuple):
    """A change of sign at ``at``; at ``low`` and ``high``, beside it, the sign is sure."""

    at: float
    low: float
    high: float

    @property
    def sharp(self) -> bool:
        return math.isfinite(self.high) and self.high - self.low <= SHARP * self.high

    @property
    def first(self) -> float:
        """Up to where nothing changes: the edge, or the last sure point before a blurred one."""
        return self.at if self.sharp or self.low == self.high else self.low

    def __str__(self) -> str:
        if self.sharp:
            return f"{self.at:.6g}"
        return f"(between {self.low:.9g} and {self.high:.9g}: rounding decides)"


class Signs(NamedTuple):
    """The sign just above w = 0 (0 of a function that is 0), where it changes, and where the
    function is 0, or may be by rounding, between points of one sign or at an end; ``complete``:
    there are no more changes at higher frequencies; ``end``: up to where it is known."""

    first: int
    edges: tuple[Edge, ...] = ()
    touches: tuple[Edge, ...] = ()
    complete: bool = True
    end: float = math.inf

    @classmethod
    def exact(cls, first: int, changes: Any, touches: Any = ()) -> Signs:
        return cls(
            first, tuple(Edge(x, x, x) for x in changes), tuple(Edge(x, x, x) for x in touches)
        )

    @classmethod
    def of(cls, function: Function, points: Any) -> Signs:
        """By ascending points, between neighbours of which the sign changes once at most."""
        x, made = np.asarray(points), np.array([function(point) for point in points])
        sure = np.flatnonzero(np.abs(made[:, 0]) > made[:, 1])
        at, above = x[sure], made[sure, 0] > 0
        turns = np.flatnonzero(above[1:] != above[:-1])
        edges = tuple(_edge(function, *at[k : k + 2].tolist()) for k in turns)
        first = 1 if not len(above) or above[0] else -1
        return cls(first, edges, tuple(_touches(function, x, sure, above)))

    @property
    def changes(self) -> tuple[float, ...]:
        return tuple(edge.at for edge in self.edges)

    @property
    def places(self) -> list[float]:
        """Where it changes and, surely, touches."""
        return sorted({*self.changes, *(e.at for e in self.touches if e.low == e.high)})

    @property
    def band_edge(self) -> float:
        """End of the band from w = 0 in which the function is above 0."""
        if self.first <= 0:
            return 0.0
        inner = [e for e in self.touches if e.low > 0]
        return min([e.first for e in (*self.edges[:1], *inner[:1])], default=self.end)

    def moved(self, place: Callable[[float], float]) -> Signs:
        """The same along another variable."""
        edges, touches = (
            tuple(Edge(*map(place, edge)) for edge in part) for part in (self.edges, self.touches)
        )
        return self._replace(edges=edges, touches=touches)

    def below(self, last: float) -> str:
        """The bands below 0, in words; ``last``: the highest frequency there is."""
        ends = [*[Edge(0.0, 0.0, 0.0)] * (self.first < 0), *self.edges]
        pairs = list(pairwise([*ends, Edge(last, last, last)]))[0::2]

        def band(low: Edge, high: Edge) -> str:
            if math.isfinite(high.at):
                return f"for {low} < w < {high} rad/s" if low.at else f"for w < {high} rad/s"
            return f"for w > {low} rad/s" if low.at else "at every w"

        if not self.complete:
            return f"first {band(*pairs[0])}, and again and again as w grows"
        more = len(pairs) - SHOWN
        said = " and ".join(band(*pair) for pair in pairs[:SHOWN])
        said += f" and at {more} higher places" if more > 0 else ""
        if self.touches and self.touches[0].low == 0 < self.touches[0].high:
            said += f"; below {self.touches[0].high:.6g} rad/s rounding decides on its sign"
        return said


def _touches(
    function: Function, x: np.ndarray, sure: np.ndarray, above: np.ndarray
) -> Iterator[Edge]:
    """The stretches of points without a sure sign, not those in which it changes."""
    ends = [-1, *sure.tolist(), len(x)]
    for i, (k, m) in enumerate(pairwise(ends)):
        inner = 0 < i < len(sure)
        if m == k + 1 or (inner and above[i] != above[i - 1]):
            continue
        low, high = float(x[k + 1]), float(x[m - 1])
        at = 0.5 * (low + high)
        low = _beside(function, low, float(x[k])) if k >= 0 else low
        yield Edge(at, low, _beside(function, high, float(x[m])) if m < len(x) else high)


def _edge(function: Function, a: float, b: float) -> Edge:
    """The change of sign between two points with different, sure signs."""
    found: Any = brentq(lambda x: function(x)[0], a, b, xtol=1e-300, rtol=np.float64(1e-13))
    at = float(found)
    return Edge(at, _beside(function, at, a), _beside(function, at, b))


def _beside(function: Function, at: float, end: float) -> float:
    """The nearest point on the way from an edge to ``end`` that has, surely, the sign there."""
    sign = math.copysign(1.0, function(end)[0])
    step = NEAREST * (abs(at) or abs(end))
    while step < abs(end - at):
        x = at + math.copysign(step, end - at)
        value, slack = function(x)
        if sign * value > slack:
            return x
        step *= FURTHER
    return end


def last(holds: Callable[[Fraction], bool], high: Fraction, bits: int = BITS) -> Fraction:
    """The largest value up to ``high`` for which it holds, as for all smaller ones; 0 for none
    above 2^-512 of it. Found by bisection, to so many bits."""
    if holds(high):
        return high
    top = Fraction(2) ** (high.numerator.bit_length() - high.denominator.bit_length() + 1)
    far = 1
    while not holds(top / 2**far):
        far *= 2
        if far > 512:
            return Fraction(0)
    powers = range(far // 2 + 1, far + 1)
    low = top / 2 ** powers[bisect_left(powers, True, key=lambda k: holds(top / 2**k))]
    steps = range(1, 2**bits)
    k = bisect_left(steps, True, key=lambda k: not holds(low + low * Fraction(k, 2**bits)))
    return low + low * Fraction(k, 2**bits)


class System:
    """T of one input and output (StateSystem: of any), as the checks see it; L of a loop.

    ``at(v)``: T at the place jv, and what rounding may change of it. ``dc()``: |T| at w = 0 (0 or
    inf: it has none), and the share of it that rounding may change. ``signs(part, level, doubt)``:
    of Re T ("real"), Im T ("imag") or |T|^2 - level ("size"), in rad/s; ``doubt``: the share of
    the level that is not sure. ``largest()``: the largest |T|, and where in rad/s. ``ends()``: the
    real values that T takes at w = 0 and as w grows. ``closed(gain)``: 1/(1 + gain T);
    ``plus(c)``: c + T; ``known(factors)``: the factor on T up to which these are all that move it
    to -1.
    """

    border = Border()
    stable: bool | None = True  # None: rounding decides
    poles: Sequence[complex] = ()  # the least stable first
    right: float = 0  # number of poles outside the border
    seen = trouble = outside = on_border = ""  # the poles, those that are not stable, ..., in words
    hidden, lost = "", False  # a mode that is not stable and does not show; whether it is outside
    size, meaning, base = "|T|", "||y||_2 <= {:.6g} ||u||_2 from rest", "T(0)"
    basis = remark = ""  # what a verdict rests on
    excess = 0  # the relative degree
    zero = False  # whether T is 0
    strange: Sequence[str] = ()  # why else T is not positive real
    limit: tuple[int, str] = (1, "")  # the sign of Re T, or w^2 Re T, as w grows, and in words
    least_stable, no_margin = "", 0.0
    fits = True  # whether 1/(1 + T) is stable, asked where Re T >= 0
    alike = 1e-9  # of T at w = 0: closer to 1 is 1
    beyond_band: Margin = NONE  # the factor on T up to which it is known beyond its band
    open_at_infinity = False  # whether |T| is not below 1 as w grows

    @property
    def unsettled(self) -> str:
        said = "T is not stable"
        if self.stable is None:
            said = "whether the system is stable is within rounding"
        return f"{said} ({self.seen})"

    def margin(self) -> float:
        """The largest eps in 1/s with T(s - eps), or T(exp(-eps dt) z), positive real."""
        return self.no_margin


def why_not(T: Any, found: Signs) -> str:
    """Why T is not positive real, by the signs of Re T; empty where it is."""
    causes = [f"T has {T.outside}"] if T.outside else []
    if found.first < 0 or found.edges:
        causes.append(f"{T.border.real} < 0 {found.below(T.border.frequency(math.inf))}")
        if not T.strange and T.limit[0] < 0:
            causes.append(T.limit[1])
    causes += T.strange
    if not (causes or T.zero or T.fits):
        causes.append(
            "a pole on the border is repeated or its residue is not positive (poles at infinity "
            f"or {T.on_border})"
        )
    return "; ".join(causes)


def realness(T: Any) -> Realness:
    found, name = T.signs("real"), T.border.real
    kind, why = "not PR", why_not(T, found)
    if not why and (T.zero or not found.first):
        kind, why = "PR", "T is zero" if T.zero else f"T is lossless, {name} = 0 at every w"
    elif not why and T.on_border:
        kind, why = "PR", f"{name} >= 0, with simple poles with positive residues {T.on_border}"
    elif not why and found.touches:
        at = ", ".join(f"{edge.at:.6g}" for edge in found.touches)
        why = f"it is 0 at w = {at} rad/s"
        if at == "0" and T.border.dt is None and not T.basis:
            why = "T has a zero at s = 0"
        kind, why = "PR", f"{name} >= 0, but {why}"
    elif not why and T.limit[0] <= 0:
        kind, why = "WSPR", f"{name} > 0 at every finite w, but {T.limit[1]}"
    elif not why:
        start = f"{T.least_stable}, " if T.least_stable else ""
        kind, why = "SPR", f"{start}{name} > 0 at every w"
        why += f" and {T.limit[1]}" if T.limit[1] else ""
    more = T.basis + T.remark + (f"; {T.hidden}" if T.hidden else "")
    margin = T.margin() if kind == "SPR" else T.no_margin
    return Realness(kind, why + more, found.band_edge, margin, bool(found.touches))
