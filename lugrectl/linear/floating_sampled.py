"""Checks of a sampled state-space model in floating point, as those of a continuous one.

T(z) is evaluated at z = (1 + jv)/(1 - jv) with the matrices as they are. Where its sign may change
comes from the continuous model with the same values: s stands for v there.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from .floating import Model, last_that_holds
from .sampled import mapped_states, on_circle
from .sure_signs import Function, SureSigns
from .transfer import require_siso
from .verdict import show_poles


class SampledModel(Model):
    """C (zI - A)^-1 B + D; ``shift``: T(exp(-shift) z) instead. Frequencies are tan(w dt/2)."""

    border = "outside the unit circle"
    name = "Re T(exp(jw dt))"

    @classmethod
    def of(cls, T: Any) -> SampledModel:
        require_siso(T, "T")
        return cls.balanced(T)

    def point(self, w: float) -> complex:
        return math.exp(-self.shift) * on_circle(w)

    @cached_property
    def poles(self) -> np.ndarray:
        """In z, the largest first."""
        poles: Any = self.response.poles
        return poles[np.lexsort((poles.imag, -np.abs(poles)))]

    @property
    def beyond(self) -> np.ndarray:
        """How far outside the unit circle the poles are."""
        return np.abs(self.poles) - 1

    def frequency(self, v: float) -> float:
        """In rad/s."""
        assert self.dt is not None
        return 2 * math.atan(v) / self.dt

    def shown(self, over: np.ndarray) -> str:
        return f"z = {show_poles([*map(complex, self.poles[over])])}"

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

    def at_infinity(self) -> tuple[float, float]:
        """The circle is closed: half the rate is a point like all others."""
        return math.inf, 0.0

    def limit(self, end: float) -> str:
        return ""

    def why_spr(self, real: np.ndarray, v: np.ndarray, limit: str) -> str:
        k = int(np.argmin(real))
        return (
            f"poles inside the unit circle (the largest |z| = {self.beyond[0] + 1:.6g}) and "
            f"{self.name} > 0 at every w, about {real[k]:.6g} at w = {self.frequency(v[k]):.6g} "
            "rad/s"
        )

    def margin(self) -> float:
        """The largest eps with T(exp(-eps dt) z) positive real."""
        assert self.dt is not None
        largest = self.beyond[0] + 1
        high = -math.log(largest) if largest else 700.0
        return last_that_holds(lambda eps: self.shifted(eps).is_real(), high) / self.dt
