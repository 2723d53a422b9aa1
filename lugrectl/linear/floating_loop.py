"""A loop of many states: margins and the count of poles from eigenvalues, in floating point."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..core.errors import InputError
from .floating import Model
from .floating_sampled import SampledModel
from .hinf import StateResponse
from .margins import Margin
from .sampled import is_sampled
from .transfer import require_siso
from .verdict import show_poles


@dataclass(frozen=True)
class FloatingLoop:
    """L = C (sI - A)^-1 B + D, or L(z) where ``dt`` is given."""

    L: Model

    @classmethod
    def of(cls, L: Any) -> FloatingLoop:
        """Raises InputError where the closed loop has no solution."""
        require_siso(L, "L")
        model = (SampledModel if is_sampled(L) else Model).balanced(L)
        if model.D == -1:
            raise InputError(
                "L(s) is -1 as s grows, so that the closed loop L/(1 + L) is improper."
            )
        return cls(model)

    @property
    def dt(self) -> float | None:
        return self.L.dt

    def frequency(self, v: float) -> float:
        """w in rad/s of the place jv."""
        return self.L.frequency(v)

    @cached_property
    def sensitivity(self) -> StateResponse:
        """1/(1 + L)."""
        M, own = self.L, 1.0 / (1.0 + self.L.D)
        A = M.A - M.B @ M.C * own
        return StateResponse(A, M.B * own, -M.C * own, np.array([[own]]), self.dt)

    @cached_property
    def counts(self) -> tuple[float, float, float]:
        """Turns about -1, and poles of L and of the closed loop that are not stable."""
        own = StateResponse(self.L.A, self.L.B, self.L.C, np.zeros((1, 1)), self.dt)
        both = own, self.sensitivity
        mine, theirs = (int((one.beyond(one.poles) > one.rounding).sum()) for one in both)
        return mine - theirs, mine, theirs

    @property
    def cause(self) -> str:
        """Why the closed loop is not stable; "" where it is."""
        closed = self.sensitivity
        right = closed.beyond(closed.poles) >= -closed.rounding
        if not right.any():
            return ""
        upper = [p for p in map(complex, closed.poles[right]) if p.imag >= 0]
        where = "right of the imaginary axis" if self.dt is None else "outside the unit circle"
        sure = "" if self.counts[2] else " or, within rounding, on its border"
        return f"it has poles {where}{sure} ({show_poles(upper)}), found in floating point"

    @property
    def high(self) -> float:
        """|L| as s, or z, grows."""
        return abs(self.L.D)

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

        found = [(w, L.real) for w, L in self._changes(part, self.L.real_zeros())]
        for v in (0.0, math.inf):
            value, slack = self.L.at(v)
            if abs(value) > slack:
                found.append((self.frequency(v), value.real))
        return [(w, x) for w, x in found if x < 0]

    def _changes(self, function: Any, zeros: np.ndarray) -> list[tuple[float, complex]]:
        edges = self.L.signs(function, self.L.places(zeros)).edges
        return [(self.frequency(e.at), self.L.at(e.at)[0]) for e in edges]

    def disk(self, skew: int = 1) -> Margin:
        """1/max |S + (skew - 1)/2| of a stable loop, S = 1/(1 + L); skew 1: least |1 + L|."""
        S = self.sensitivity
        most, w = S.plus(0.5 * (skew - 1)).peak()
        return Margin(1.0 / most if most else math.inf, w)

    def known(self, factors: list[float]) -> float:
        """The factor on L up to which ``factors`` are all that move it to -1: a beginning or an end
        of L that is 0 within rounding may be reached beyond it."""
        ends = [slack for value, slack in map(self.L.at, (0.0, math.inf)) if abs(value) <= slack]
        return min((1.0 / float(slack) for slack in ends if slack), default=math.inf)

    def unstable_poles(self, gain: float) -> float:
        """Poles of the loop with L times ``gain`` that are not stable."""
        M = replace(self.L, C=gain * self.L.C, D=gain * self.L.D)
        return FloatingLoop(M).counts[2] if M.D != -1 else math.nan
