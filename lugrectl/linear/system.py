"""What every check asks of a system, how it follows it along the axis, and what it answers.

A check is ``of(T)``: a system; signs of Re T, Im T or |T|^2 along the axis, and numbers; a verdict.
There are systems with exact coefficients, with dead times, of many states, and measured ones. Those
of floating point are evaluated at many frequencies at once, dense about every pole and zero and in
every turn of a dead time: between two of these a function changes its sign once at most, or has one
extreme, which is looked for.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import fields
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np

from ..core.errors import InputError
from ..core.result import Result
from .transfer import Border, to_float

Function = Callable[[np.ndarray], np.ndarray]
SHOWN = 2  # bands below 0 that are named
PER_DECADE, PER_TURN = 50, 16  # points
BEYOND = 30.0  # they reach this factor beyond the outermost pole, zero or mark
ROUND = np.tan(np.linspace(-1.5, 1.5, 61))  # points about each pole, in widths of its peak
PARTS = 16  # of a stretch in which an extreme or a change of sign is looked for
STEP = 0.8  # rad that a function turns between two points at most
MOST = 2_000_000  # points
BITS, FEWER = 42, 24  # of a limit that is bisected, in exact arithmetic and in floating point
PEAKS = 10  # that are looked at for the largest
SAME = 1e-12  # of the largest |T|: what is larger by less is not
NO_RATE = "; T has no stated sample time, so that 1 s is taken: give its dt"


def spread(
    roots: Any, *marks: float, late: float = 0.0, top: float = math.inf, end: float = math.inf
) -> np.ndarray:
    """Frequencies from far below to far above all roots (1/s) and marks, or to ``end``, never above
    ``top``; ``late``: the longest dead time in s."""
    roots = np.asarray(roots, dtype=complex)
    places = np.array([*np.abs(roots), *marks, 1.0 / late if late else 0.0, end])
    places = places[(places > 0.0) & (places <= min(top, 1e100))]
    places = places if len(places) else np.array([min(top / BEYOND, 1.0)])
    low = float(places.min()) / BEYOND
    high = min(max(end if math.isfinite(end) else BEYOND * places.max(), 2.0 * low), top)
    turns = high * late * PER_TURN / (2.0 * math.pi)
    if turns > MOST:
        raise InputError(
            "the response turns too often to be followed: dead time times bandwidth is above "
            "about 1e5; check the unit of the dead time, s."
        )
    peaks = np.abs(roots.imag)[:, None] + np.abs(roots.real)[:, None] * ROUND
    even = np.geomspace(low, high, math.ceil(PER_DECADE * math.log10(high / low)) + 2)
    w = np.concatenate([even, places, peaks.ravel(), np.arange(1.0, turns) * high / (turns or 1.0)])
    return np.unique(w[(w >= low) & (w <= high)])


def from_0(w: np.ndarray) -> np.ndarray:
    """0 and a few frequencies far below the others, too."""
    return np.concatenate([[0.0], np.geomspace(1e-9 * w[0], w[0], 91)[:-1], w])


def tops(
    f: Function, low: np.ndarray, high: np.ndarray, rounds: int = 8
) -> tuple[np.ndarray, np.ndarray]:
    """Where f is largest in each of many intervals with one extreme, and its value there."""
    each = np.arange(len(low))
    for _ in range(rounds):
        w = np.linspace(low, high, PARTS + 1)
        values = f(w.ravel()).reshape(w.shape)
        k, step = np.argmax(values, axis=0), (high - low) / PARTS
        at = w[k, each]
        low, high = np.maximum(at - step, low), np.minimum(at + step, high)
    return at, values[k, each]


def roots(f: Function, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where f changes its sign in each of many intervals."""
    each = np.arange(len(low))
    for _ in range(13):
        w = np.linspace(low, high, PARTS + 1)
        above = (f(w.ravel()) > 0).reshape(w.shape)
        k = np.argmax(above[1:] != above[0], axis=0)
        low, high = w[k, each], w[k + 1, each]
    return 0.5 * (low + high)


def with_extremes(
    function: Callable[[np.ndarray], Any], w: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The frequencies, those between them at which a function is next to 0 too, its values and what
    rounding may change of these."""

    def towards_0(x: np.ndarray) -> np.ndarray:
        return -function(x)[0] * np.broadcast_to(sign, (PARTS + 1, len(sign))).ravel()

    value, slack = np.broadcast_arrays(*function(w))
    size = np.abs(np.where(np.isfinite(value), value, np.inf))
    k = 1 + np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:]))
    k = k[(value[k] * value[k - 1] > 0) & (value[k] * value[k + 1] > 0)]
    if len(k):
        sign = np.sign(value[k])
        at, _ = tops(towards_0, w[k - 1], w[k + 1], 5)
        more = (at, *np.broadcast_arrays(*function(at)))
        w, value, slack = (np.append(*pair) for pair in zip((w, value, slack), more, strict=True))
        order = np.argsort(w, kind="stable")
        w, value, slack = w[order], value[order], slack[order]
    return w, value, slack


def turned(f: Function, w: np.ndarray) -> tuple[np.ndarray, float, float | None]:
    """The frequencies, with more of them where f turns fast; the angle in rad by which it turns
    from the first to the last; and a place at which it is 0 within rounding."""
    while len(w) < MOST:
        values = f(w)
        if (zero := w[values == 0.0]).size:
            return w, math.nan, float(zero[0])
        angles = np.angle(values[1:] / values[:-1])
        k = np.flatnonzero(np.abs(angles) > STEP)
        if not len(k):
            return w, float(angles.sum()), None
        lost = w[k + 1] - w[k] < 1e-14 * w[k + 1]
        if lost.any():
            return w, math.nan, float(w[k[lost][0]])
        w = np.insert(w, k + 1, 0.5 * (w[k] + w[k + 1]))
    raise InputError("the response turns too often to be followed.")


class Signs(NamedTuple):
    """The sign just above w = 0 (0 of a function that is 0), where it changes, and where the
    function is 0, or may be by rounding, between points of one sign or at an end; ``complete``:
    there are no more changes at higher frequencies; ``end``: up to where it is known."""

    first: int
    changes: tuple[float, ...] = ()
    touches: tuple[float, ...] = ()
    complete: bool = True
    end: float = math.inf

    @classmethod
    def of(cls, function: Callable[[np.ndarray], Any], w: np.ndarray) -> Signs:
        """Of a function and what rounding may change of it."""
        w, value, slack = with_extremes(function, w)
        sure = np.flatnonzero(np.abs(value) > slack)
        at, above = w[sure], value[sure] > 0
        turns = np.flatnonzero(above[1:] != above[:-1])
        changes = roots(lambda x: function(x)[0], at[turns], at[turns + 1]).tolist()
        gaps = enumerate(pairwise([-1, *sure.tolist(), len(w)]))
        touches = [float(w[a + 1]) for i, (a, b) in gaps if b > a + 1 and i - 1 not in turns]
        return cls(1 if not len(above) or above[0] else -1, tuple(changes), tuple(touches))

    @property
    def places(self) -> list[float]:
        return sorted({*self.changes, *self.touches})

    @property
    def band_edge(self) -> float:
        """End of the band from w = 0 in which the function is above 0."""
        if self.first <= 0:
            return 0.0
        return min([*self.changes[:1], *[w for w in self.touches if w > 0][:1]], default=self.end)

    def moved(self, place: Callable[[float], float]) -> Signs:
        """The same along another variable."""
        changes, touches = (tuple(map(place, part)) for part in (self.changes, self.touches))
        return self._replace(changes=changes, touches=touches)

    def below(self, last: float) -> str:
        """The bands below 0, in words; ``last``: the highest frequency there is."""
        pairs: Sequence[tuple[float, float]]
        pairs = list(pairwise([*[0.0] * (self.first < 0), *self.changes, last]))[0::2]

        def band(low: float, high: float) -> str:
            if math.isfinite(high):
                start = f"{low:.6g} < w" if low else "w"
                return f"for {start} < {high:.6g} rad/s"
            return f"for w > {low:.6g} rad/s" if low else "at every w"

        if not self.complete:
            return f"first {band(*pairs[0])}, and again and again as w grows"
        more = len(pairs) - SHOWN
        said = " and ".join(band(*pair) for pair in pairs[:SHOWN])
        return said + (f" and at {more} higher places" if more > 0 else "")


class Verdict(Result):
    """Base of the frozen verdict dataclasses; truthy when the property holds."""

    reason: str
    _source: Any = None

    def summary(self) -> dict[str, Any]:
        """Plain Python: ``holds`` and every field; a complex number becomes [re, im]."""
        values = {f.name: _plain(getattr(self, f.name)) for f in fields(self)}  # type: ignore
        return {"holds": bool(self), **values}

    def of(self, source: Any) -> Self:
        """The verdict, which remembers what was checked, for :meth:`plot`.

        Without a stated sample time (dt is True) it is per sample.
        """
        object.__setattr__(self, "_source", source)
        if getattr(source, "dt", None) is True:
            object.__setattr__(self, "reason", self.reason.rstrip(".") + NO_RATE)
        return self

    def __str__(self) -> str:
        rows = [f"  {row.name}: {row.text()}" for row in self._rows()]
        return "\n".join([self._title(), *rows])

    def _title(self) -> str:
        return f"{type(self).__name__}: {'holds' if self else 'does not hold'}"


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return [value.real, value.imag] if isinstance(value, complex) else value


class Realness(NamedTuple):
    """The kind of T ("SPR", "WSPR", "PR", "not PR"), why, its band edge and its margin;
    ``rounded``: floating point cannot tell it from a neighbour."""

    kind: str
    reason: str
    edge: float = math.inf
    margin: float = 0.0
    rounded: bool = False


class Margin(NamedTuple):
    """A margin, and its frequency in rad/s (nan where there is none)."""

    value: float = math.inf
    at: float = math.nan


NONE, UNKNOWN = Margin(), Margin(math.nan)


def last(holds: Callable[[Fraction], bool], high: Fraction, bits: int = BITS) -> Fraction:
    """The largest value up to ``high`` for which it holds, as for all smaller ones; 0 for none
    above 2^-512 of it. Found by bisection, to so many bits."""
    one = 1 << bits
    top = Fraction(2) ** (high.numerator.bit_length() - high.denominator.bit_length() + 1)

    def value(k: int) -> Fraction:
        return min(high, top * Fraction(one + k % one, one) / 2 ** (512 - k // one))

    if holds(high):
        return high
    if not holds(value(0)):
        return Fraction(0)
    return value(bisect_left(range(512 * one), True, key=lambda k: not holds(value(k))) - 1)


class System:
    """T of one input and output (StateSystem: of any), as the checks see it; L of a loop.

    ``at(w)``: T at frequencies in rad/s, and what rounding may change of it. ``dc()``: |T| at
    w = 0 (0 or inf: it has none). ``signs(part, level)``: of Re T ("real"), Im T ("imag") or
    |T|^2 - level ("size"). ``largest()``: the largest |T|, and where. ``ends()``: the real values
    that T takes at w = 0 and as w grows. ``closed(gain)``: 1/(1 + gain T); ``plus(c)``: c + T;
    ``known(factors)``: the factor on T up to which these are all that move it to -1.
    """

    border = Border()
    poles: Sequence[complex] = ()  # the least stable first; none where they are not computed
    right: float = 0  # number of poles outside the border
    on: Sequence[float] = ()  # frequencies of poles on it
    hidden, lost = "", False  # a mode that is not stable and does not show; whether it is outside
    size, meaning, base = "|T|", "||y||_2 <= {:.6g} ||u||_2 from rest", "T(0)"
    basis = ""  # what a verdict rests on
    excess = 0  # the relative degree
    zero = False  # whether T is 0
    strange: Sequence[str] = ()  # why else T is not positive real
    limit: tuple[int, str] = (1, "")  # the sign of Re T, or w^2 Re T, as w grows, and in words
    no_margin = 0.0
    fits = True  # whether 1/(1 + T) is stable, asked where Re T >= 0
    alike = 1e-9  # of T at w = 0: closer to 1 is 1
    beyond_band: Margin = NONE  # the factor on T up to which it is known beyond its band
    open_at_infinity = False  # whether |T| is not below 1 as w grows

    @property
    def stable(self) -> Any:
        """None: rounding decides."""
        return not (self.right or self.on)

    @property
    def outside(self) -> str:
        """The poles outside the border, in words."""
        if math.isnan(self.right):
            return (
                "any number of poles: this is not decided, |L| must be below 1 at the highest "
                "frequency; measure up to higher ones"
            )
        if math.isinf(self.right):
            return (
                "infinitely many poles right of the imaginary axis, or as near to it as any: a "
                "dead time acts on the highest power of s"
            )
        shown = self.poles[: int(self.right)]
        many = f"{self.right:.0f} pole{'s' * (self.right != 1)} {self.border.outside}"
        many += f" ({self.border.show(shown)})" if len(shown) else ""
        return many if self.right else ""

    @property
    def on_border(self) -> str:
        at = ", ".join(f"{w:.6g}" for w in self.on)
        return f"{self.border.on} at w = {at} rad/s" if at else ""

    @property
    def trouble(self) -> str:
        """The poles that are not stable, in words."""
        return self.outside or (f"a pole {self.on_border}" if self.on_border else "")

    @property
    def least_stable(self) -> str:
        return self.border.least_stable(self.poles)

    @property
    def unsettled(self) -> str:
        said = "T is not stable"
        if self.stable is None:
            said = "whether the system is stable is within rounding"
        return f"{said} ({self.border.show(self.poles) if len(self.poles) else self.trouble})"

    def margin(self) -> float:
        """The largest eps in 1/s with T(s - eps), or T(exp(-eps dt) z), positive real."""
        return self.no_margin


class Followed(System):
    """A system that is known by its values: ``grid(part, level)``, frequencies from 0 on, up to
    which they tell a part of it, and whether there is no more beyond."""

    def grid(self, part: str, level: float) -> tuple[np.ndarray, bool]:
        raise NotImplementedError

    def at(self, w: Any) -> tuple[Any, Any]:
        raise NotImplementedError

    def ends(self) -> list[tuple[float, float]]:
        raise NotImplementedError

    def sizes(self, w: np.ndarray) -> np.ndarray:
        return np.abs(self.at(w)[0])

    def part(self, w: np.ndarray, part: str, level: float) -> tuple[np.ndarray, Any]:
        T, slack = self.at(w)
        if part != "size":
            return getattr(T, part), slack
        finite = np.isfinite(T)  # it is so but at a pole
        above = np.where(finite, np.abs(T) ** 2 / level, np.inf)
        return above - 1.0, np.where(finite, 2.0 * np.sqrt(above / level) * slack, 0.0) + 1e-15

    def signs(self, part: str, level: Any = 0) -> Signs:
        least = to_float(Fraction(level))
        w, complete = self.grid(part, least)
        with np.errstate(all="ignore"):
            found = Signs.of(lambda x: self.part(x, part, least), w)
        return found._replace(complete=complete)

    def nowhere_below_0(self, w: np.ndarray) -> bool:
        """Whether Re T is so beyond rounding."""
        with np.errstate(all="ignore"):
            _, value, slack = with_extremes(lambda x: self.part(x, "real", 0.0), w)
        return not (value < -slack).any()

    def largest(self) -> tuple[float, float]:
        w, _ = self.grid("largest", 0.0)
        sizes = self.sizes(w)
        k = np.flatnonzero((sizes[1:-1] >= sizes[:-2]) & (sizes[1:-1] >= sizes[2:])) + 1
        k = k[np.argsort(-sizes[k])[:PEAKS]]
        at, values = tops(self.sizes, w[k - 1], w[k + 1])
        found = [(float(sizes[0]), float(w[0])), *zip(values.tolist(), at.tolist(), strict=True)]
        found += [(float(sizes[-1]), float(w[-1])), *((abs(x), end) for end, x in self.ends())]
        best = max(found)[0] * (1.0 - SAME)
        return next(one for one in found if one[0] >= best)


def why_not(T: Any, found: Signs) -> str:
    """Why T is not positive real, by the signs of Re T; empty where it is."""
    causes = [f"T has {T.outside}"] if T.outside else []
    if found.first < 0 or found.changes:
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
    kind, why = "PR", why_not(T, found)
    if why:
        kind = "not PR"
    elif T.zero or not found.first:
        why = "T is zero" if T.zero else f"T is lossless, {name} = 0 at every w"
    elif T.on_border:
        why = f"{name} >= 0, with simple poles with positive residues {T.on_border}"
    elif found.touches:
        at = ", ".join(f"{w:.6g}" for w in found.touches)
        at_0 = at == "0" and T.border.dt is None and not T.basis
        why = "T has a zero at s = 0" if at_0 else f"it is 0 at w = {at} rad/s"
        why = f"{name} >= 0, but {why}"
    elif T.limit[0] <= 0:
        kind, why = "WSPR", f"{name} > 0 at every finite w, but {T.limit[1]}"
    else:
        start = f"{T.least_stable}, " if T.least_stable else ""
        kind, why = "SPR", f"{start}{name} > 0 at every w"
        why += f" and {T.limit[1]}" if T.limit[1] else ""
    more = T.basis + (f"; {T.hidden}" if T.hidden else "")
    margin = T.margin() if kind == "SPR" else T.no_margin
    return Realness(kind, why + more, found.band_edge, margin, bool(found.touches))
