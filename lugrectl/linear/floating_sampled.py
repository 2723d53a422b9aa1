"""Checks of a sampled state-space model in floating point, as those of a continuous one.

T(z) is evaluated at z = (1 + jv)/(1 - jv) with the matrices as they are. Where its sign may change
comes from the continuous model with the same values: s stands for v there.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from .floating import EPS as ROUNDING
from .floating import Model, Realness, is_seen, last_that_holds
from .sampled import mapped_states, on_circle, sample_time
from .sure_signs import Function, SureSigns
from .transfer import require_siso
from .verdict import show_poles


class SampledModel(Model):
    """C (zI - A)^-1 B + D; ``shift``: T(exp(-shift) z) instead. Frequencies are tan(w dt/2)."""

    @classmethod
    def of(cls, T: Any) -> SampledModel:
        require_siso(T, "T")
        return cls.balanced(T)

    def point(self, w: float) -> complex:
        return math.exp(-self.shift) * on_circle(w)

    @property
    def largest(self) -> float:
        """The largest |z| of a pole."""
        return float(np.abs(self.poles).max())

    @cached_property
    def poles(self) -> np.ndarray:
        """In z, the largest first."""
        poles = np.linalg.eigvals(self.A)
        return poles[np.lexsort((poles.imag, -np.abs(poles)))]

    @property
    def stable(self) -> bool:
        return self.largest < 1

    @property
    def decided(self) -> bool:
        return bool(np.abs(np.abs(self.poles) - 1).min() > self.uncertain)

    @property
    def uncertain(self) -> float:
        """A distance of a pole from the unit circle below which rounding decides on its side."""
        return 1e3 * ROUNDING * max(self.norm, 1.0)

    @cached_property
    def marks(self) -> np.ndarray:
        with np.errstate(all="ignore"):
            return (self.poles - 1) / (self.poles + 1)

    @property
    def continuous(self) -> Model:
        """The model in v."""
        grow = math.exp(self.shift)
        A, B, C, D = mapped_states(self.A * grow, self.B, self.C * grow, np.atleast_2d(self.D))
        return Model(A, B, C, float(D[0, 0]))

    def _mirrored_zeros(self, sign: float) -> np.ndarray:
        return self.continuous._mirrored_zeros(sign)

    def level_zeros(self, square: float) -> np.ndarray:
        return self.continuous.level_zeros(square)

    def signs(self, function: Function, points: np.ndarray, values: Any = None) -> SureSigns:
        """As of a continuous model, along the circle: v ends at infinity."""
        along = SureSigns.of(lambda x: function(math.tan(x)), np.arctan(points), values)
        return along.moved(math.tan)

    def places(self, zeros: np.ndarray) -> np.ndarray:
        return np.append(super().places(zeros), math.inf)


def realness(T: Any) -> Realness:
    """The kind of a sampled T; "" where a pole is on the circle or cancels outside it."""
    model, dt = SampledModel.of(T), sample_time(T)
    if not len(model.A):
        return Realness("", "no poles")
    if model.largest > 1 - model.uncertain:
        if model.largest <= 1 + model.uncertain or not is_seen(model, np.abs):
            return Realness("", "a pole on the circle, or one that cancels")
        shown = show_poles([p for p in map(complex, model.poles) if abs(p) > 1])
        return Realness("not PR", f"T has poles outside the unit circle (z = {shown})", 0.0)
    v = model.places(model.realness_zeros())
    w = 2 * np.arctan(v) / dt
    values = np.array([model.real_part(x) for x in v])
    real, slack = values.T
    if (real < -slack).any():
        return _not_real(model, v, values, dt)
    k = int(np.argmin(real - slack))
    if real[k] <= slack[k]:
        reason = f"Re T(exp(jw dt)) >= 0, but it is 0 at w = {w[k]:.6g} rad/s within rounding"
        return Realness("PR", reason, float(w[k]) or math.inf, rounded=True)
    k = int(np.argmin(real))
    reason = (
        f"poles inside the unit circle (the largest |z| = {model.largest:.6g}) and "
        f"Re T(exp(jw dt)) > 0 at every w, about {real[k]:.6g} at w = {w[k]:.6g} rad/s"
    )
    return Realness("SPR", reason, math.inf, _margin(model) / dt)


def _not_real(model: SampledModel, v: np.ndarray, values: np.ndarray, dt: float) -> Realness:
    """The first band with Re T < 0."""
    signs = model.signs(model.real_part, v, values)
    low, high, later = signs.moved(lambda x: 2 * math.atan(x) / dt).first_band()
    more = " and at higher places" if later else ""
    end = high or f"{math.pi / dt:.6g}"
    reason = f"Re T(exp(jw dt)) < 0 for {low} < w < {end} rad/s{more}"
    return Realness("not PR", reason, low.first)


def _margin(model: SampledModel) -> float:
    """The largest eps dt with T(exp(-eps dt) z) positive real."""
    high = -math.log(model.largest) if model.largest else 700.0
    return last_that_holds(lambda eps: model.shifted(eps).is_real(), high)
