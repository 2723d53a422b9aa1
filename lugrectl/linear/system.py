"""What every check asks of a system.

A check is ``of(T)``: a system; signs of Re T, Im T or |T|^2 along the axis, and numbers; a verdict.
There are systems with exact coefficients, with dead times, of many states, and measured ones.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from .axis import Signs, tops
from .border import Border
from .transfer import to_float
from .verdict import NONE, Margin, Realness

BITS, FEWER = 42, 24  # of a limit that is bisected, in exact arithmetic and in floating point
PEAKS = 10  # that are looked at for the largest
SAME = 1e-12  # of the largest |T|: what is larger by less is not


def last(holds: Callable[[Fraction], bool], high: Fraction, bits: int = BITS) -> Fraction:
    """The largest value up to ``high`` for which it holds, as for all smaller ones; 0 for none
    above 2^-512 of it. Found by bisection, to so many bits."""
    one = 1 << bits
    top = Fraction(2) ** (high.numerator.bit_length() - high.denominator.bit_length() + 1)

    def value(k: int) -> Fraction:
        return min(high, top * Fraction(one + k % one, one) / 2 ** (512 - k // one))

    if holds(high):
        return high
    k = bisect_left(range(512 * one), True, key=lambda k: not holds(value(k)))
    return value(k - 1) if k else Fraction(0)


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
    def stable(self) -> bool | None:
        """None: rounding decides."""
        return not (self.right or self.on)

    @property
    def outside(self) -> str:
        """The poles outside the border, in words."""
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

    def at(self, w: np.ndarray) -> tuple[np.ndarray, Any]:
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
