"""Checks of a state-space model in floating point, at the cost of a few eigenvalue problems.

Between neighbouring zeros of T(s) + T(-s), or of |T|^2 - c, on the imaginary axis nothing changes
its sign: a point in each gap decides, with what rounding of the matrices may change there. Times
grow with the third power of the order; exact arithmetic takes minutes at 30 states.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from .hinf import StateResponse
from .pencil import EPS, balanced, level_zeros, solve_shifted, zeros_of
from .sampled import is_sampled, sample_time
from .sure_signs import Edge, Function, SureSigns
from .transfer import require_continuous_siso
from .verdict import show_poles

HALVINGS = 40
AT_BORDER = "within rounding on the border of stability"
SINGLE = 1e-9  # relative distance of two candidates that count as one


@dataclass(frozen=True)
class Model:
    """C (sI - A)^-1 B + D with one input and one output; ``shift``: T(s - shift) instead.

    Of T(z) ``dt`` is given: :class:`floating_sampled.SampledModel`.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: float
    dt: float | None = None
    shift: float = 0.0
    border = "right of the imaginary axis"
    name = "Re T(jw)"

    @classmethod
    def of(cls, T: Any) -> Model:
        require_continuous_siso(T, "T")
        return cls.balanced(T)

    @classmethod
    def balanced(cls, T: Any) -> Self:
        """In the units of :func:`pencil.balanced`."""
        A, B, C, D = balanced(*(np.asarray(M, dtype=float) for M in (T.A, T.B, T.C, T.D)))
        return cls(A, B, C, float(D[0, 0]), sample_time(T) if is_sampled(T) else None)

    @cached_property
    def response(self) -> StateResponse:
        return StateResponse(self.A, self.B, self.C, np.atleast_2d(self.D), self.dt)

    def seen(self) -> tuple[Self, str]:
        """The same without modes that are not stable and do not show, and a remark on them."""
        whole = self.response
        if whole.stable:
            return self, ""
        part, unseen = whole.split()
        if not len(unseen):
            return self, ""
        return replace(self, A=part.A, B=part.B, C=part.C), whole.says_hidden(unseen)

    @cached_property
    def norm(self) -> float:
        return float(np.linalg.norm(self.A))

    @cached_property
    def triangular(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, B and C in the coordinates in which A is triangular."""
        S, b, c = self.response.triangular
        return S, b[:, 0], c[0]

    @cached_property
    def poles(self) -> np.ndarray:
        """In 1/s, rightmost first, without the shift."""
        poles: Any = self.response.poles
        return poles[np.lexsort((poles.imag, -poles.real))]

    @property
    def uncertain(self) -> float:
        """A real part of a pole in 1/s below which rounding decides on its side."""
        return self.response.rounding

    @property
    def beyond(self) -> np.ndarray:
        """How far right of the axis the poles are."""
        return np.real(self.poles)

    @property
    def stable(self) -> bool | None:
        """Whether every pole is left of the axis; None where rounding hides it."""
        return self.response.stable or self.response.settled()

    def frequency(self, v: float) -> float:
        """In rad/s."""
        return v

    def shown(self, over: np.ndarray) -> str:
        """Those poles in words."""
        return f"{show_poles([*map(complex, self.poles[over])])} 1/s"

    def at(self, w: float) -> tuple[complex, float]:
        """T(jw), and what rounding of the matrices may change of it."""
        S, b, c = self.triangular
        s = self.point(w)
        if math.isinf(abs(s)):
            return complex(self.D), 0.0
        right, left = solve_shifted(S, b, s), solve_shifted(S, c, s, transposed=True)
        if right is None or left is None:
            return complex(math.nan), math.inf
        reach = float(np.linalg.norm(left) * np.linalg.norm(right))
        size = float(np.linalg.norm(c) * np.linalg.norm(right)) + abs(self.D)
        return complex(c @ right) + self.D, EPS * ((self.norm + abs(s)) * reach + size)

    def real_part(self, w: float) -> tuple[float, float]:
        """Re T(jw), and what rounding of the matrices may change of it."""
        t, slack = self.at(w)
        return t.real, slack

    def point(self, w: float) -> complex:
        """Where on the axis, moved by the shift, w is."""
        return 1j * w - self.shift

    @property
    def marks(self) -> np.ndarray:
        """The poles, in the variable whose imaginary axis the frequencies lie on."""
        return self.poles

    def places(self, zeros: np.ndarray) -> np.ndarray:
        """0, the frequencies of zeros and poles, points between them and beyond, in rad/s."""
        marks = np.concatenate([zeros, self.marks])
        marks = np.concatenate([np.abs(marks), np.abs(np.imag(marks))])
        marks = np.sort(marks[np.isfinite(marks) & (marks > 0)])
        marks = marks[np.append(True, np.diff(marks) > SINGLE * marks[1:])] if len(marks) else marks
        if not len(marks):
            return np.array([0.0, 1.0])
        between = np.sqrt(marks[1:] * marks[:-1])
        return np.sort(np.concatenate([[0.0, 0.1 * marks[0], 10 * marks[-1]], marks, between]))

    def signs(self, function: Function, points: np.ndarray, values: Any = None) -> SureSigns:
        """The signs of a function of frequency, and where they change."""
        return SureSigns.of(function, points, values)

    def realness_zeros(self) -> np.ndarray:
        """The zeros of T(s) + T(-s)."""
        return self._mirrored_zeros(1.0)

    def real_zeros(self) -> np.ndarray:
        """The zeros of T(s) - T(-s), among them where T(jw) is real."""
        return self._mirrored_zeros(-1.0)

    def _mirrored_zeros(self, sign: float) -> np.ndarray:
        A = self.A + self.shift * np.eye(len(self.A))
        zero = np.zeros_like(A)
        return zeros_of(
            np.block([[A, zero], [zero, -A.T]]),
            np.vstack([self.B, self.C.T]),
            np.hstack([self.C, -sign * self.B.T]),
            (1.0 + sign) * self.D,
        )

    def level_zeros(self, square: float) -> np.ndarray:
        """The zeros of T(s) T(-s) - square."""
        return level_zeros(self.A, self.B, self.C, np.atleast_2d(self.D), square)

    def shifted(self, eps: float) -> Self:
        """The same with another shift."""
        moved = replace(self, shift=eps)
        vars(moved)["triangular"], vars(moved)["poles"] = self.triangular, self.poles
        return moved

    def is_real(self) -> bool:
        """Whether Re T is nowhere negative beyond rounding, where its sign may change."""
        end, least = self.at_infinity()
        values = map(self.at, self.places(self.realness_zeros()))
        return end >= -least and all(t.real >= -slack for t, slack in values)

    def at_infinity(self) -> tuple[float, float]:
        """The limit of Re T(jw), or without D of w^2 Re T(jw), and what rounding may change."""
        if self.D:
            return self.D, 0.0
        A = self.A + self.shift * np.eye(len(self.A))
        sizes = np.linalg.norm(self.C) * np.linalg.norm(self.B) * self.norm
        return -float(np.real(self.C @ A @ self.B)[0, 0]), EPS * float(sizes)

    def limit(self, end: float) -> str:
        """What Re T tends to, in words."""
        power = self.name if self.D else f"w^2 {self.name}"
        return f"{power} tends to {end:.6g} as w grows"

    def why_spr(self, real: np.ndarray, v: np.ndarray, limit: str) -> str:
        return (
            f"poles left of the axis (the rightmost at Re s = {self.poles[0].real:.6g} 1/s), "
            f"{self.name} > 0 at every w and {limit}"
        )

    def margin(self) -> float:
        """The largest eps with T(s - eps) positive real."""
        return last_that_holds(lambda eps: self.shifted(eps).is_real(), -self.beyond.max())


@dataclass(frozen=True)
class Realness:
    """What floating point says of Re T(jw): a kind, "" where it cannot say; why; the band edge."""

    kind: str
    reason: str
    edge: float = math.inf
    margin: float = 0.0
    rounded: bool = False


def realness(model: Model) -> Realness:
    """The kind of a model whose modes that are not stable all show."""
    v = model.places(model.realness_zeros())
    values = np.array([model.real_part(x) for x in v])
    end, least = model.at_infinity()
    signs = model.signs(model.real_part, v, values).moved(model.frequency)
    if end < -least:
        signs = signs.below_beyond()
    touch = next((zone for zone in signs.touches if zone.low > 0), None)
    below, why = _first_below(model, signs, touch)
    if (over := model.beyond > model.uncertain).any():
        poles = f"T has poles {model.border} ({model.shown(over)})"
        blur = f"{model.name} is 0 within rounding at {touch} rad/s" if touch else ""
        return Realness("not PR", "; ".join(filter(None, [poles, why or blur])), below)
    if why:
        return Realness("not PR", why, below)
    if model.beyond.max() > -model.uncertain:
        return _on_the_border(model)
    if signs.touches:
        w = signs.touches[0].at if touch is None else touch.at
        reason = f"{model.name} >= 0, but it is 0 at w = {w:.6g} rad/s within rounding"
        return Realness("PR", reason, touch.first if touch else math.inf, rounded=True)
    limit = model.limit(end)
    if limit and end <= least:
        return Realness("WSPR", f"{model.name} > 0 at every finite w, but {limit} within rounding")
    return Realness("SPR", model.why_spr(values[:, 0], v, limit), math.inf, model.margin())


def _on_the_border(model: Model) -> Realness:
    """The kind of a model with poles that are, within rounding, neither stable nor unstable."""
    at = model.shown(model.beyond > -model.uncertain)
    own = 1.0 + model.D
    closed = replace(model, A=model.A - model.B @ model.C / own) if own > 0 else None
    if closed is None or (closed.beyond > closed.uncertain).any():  # n + d is not Hurwitz
        why = f"a pole is repeated or its residue is not positive where T has one, at {at}"
        return Realness("not PR", f"{why}, {AT_BORDER}")
    return Realness("PR", f"{model.name} >= 0, with poles, {AT_BORDER}: {at}")


def _first_below(model: Model, signs: SureSigns, touch: Edge | None) -> tuple[float, str]:
    """Up to where Re T > 0 in rad/s, and the first band with Re T < 0 in words, if there is one.

    ``touch``: where Re T is first 0 within rounding, w = 0 apart.
    """
    if signs.above.all():
        return touch.first if touch else math.inf, ""
    low, high, later = signs.first_band()
    said = f"{model.name} < 0 for w > {low} rad/s"
    last = model.frequency(math.inf)
    if high is not None or math.isfinite(last):
        more = f" and at {later} higher places" if later else ""
        said = f"{model.name} < 0 for {low} < w < {high or f'{last:.6g}'} rad/s{more}"
    if signs.touches and not signs.touches[0].low:
        said += f"; below {signs.touches[0].high:.6g} rad/s rounding decides on its sign"
    if touch is None or touch.low > low.first:
        return low.first, said
    return touch.first, f"{said}; before it, it is 0 within rounding at {touch} rad/s"


def last_that_holds(holds: Callable[[float], bool], high: float) -> float:
    """The largest value up to ``high`` for which it holds, as for all smaller ones; bisection."""
    if holds(high * (1 - 1e-12)):
        return high
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def level_signs(model: Model, power: float) -> SureSigns:
    """Where |T(jw)|^2 changes its side of ``power`` |T(0)|^2, in rad/s, ascending."""
    dc, rounding = model.at(0.0)
    square = power * abs(dc) ** 2

    def above(w: float) -> tuple[float, float]:
        t, slack = model.at(w)
        size = abs(t) ** 2 / square
        return size - 1.0, 2 * size * (slack / max(abs(t), slack) + rounding / abs(dc)) + EPS

    signs = model.signs(above, model.places(model.level_zeros(square)))
    return signs.moved(model.frequency)
