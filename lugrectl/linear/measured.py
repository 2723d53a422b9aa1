"""A measured frequency response: the checks hold for its frequencies, and say so.

Between two frequencies log |L| and the phase of an open loop are straight lines over log w (over w
from w = 0); its margins and Nyquist's criterion are exact for these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from .border import Axis
from .margins import Loop
from .transfer import response, span
from .verdict import Falls, Margin, Realness

LEAST = 1e-300
NEAR = 8  # steps between two frequencies, about which |1 + L| is then minimised
AMONG = 3  # of the lowest of these
LIKE_1 = 0.02  # of a measured L: closer to 1 is 1
BEYOND = "on whether T is stable, it says nothing"


@dataclass(frozen=True)
class MeasuredSystem:
    """T(jw) at frequencies w in rad/s."""

    w: np.ndarray
    values: np.ndarray
    border, stable, poles, seen, hidden, size = Axis(), True, (), "", "", "|T|"
    meaning = "the L2 gain is at least {:.6g}"

    @classmethod
    def of(cls, T: Any, name: str = "T") -> MeasuredSystem:
        """Raises InputError for a response that is not finite."""
        return cls(*response(T, name))

    @property
    def said(self) -> str:
        """What the largest value rests on."""
        return f", of {span(self.w)}; between and outside them, and {BEYOND}"

    def no_gain(self) -> None:
        """Why there is no L2 gain."""

    def largest(self) -> tuple[float, float]:
        """The largest |T|, and its frequency."""
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
        turns = 1 + np.flatnonzero((above[1:] < 0) != (above[:-1] < 0))
        found = tuple(_between(w, above, int(k)) for k in turns)
        return Falls(float(size[0]), found, min(found, default=math.inf), said, "")

    def realness(self) -> Realness:
        """What the signs of Re T(jw) at the measured frequencies say of T."""
        w, real = self.w, np.real(self.values)
        if (real < 0).any():
            reason = f"Re T(jw) < 0 {_bands(w, real)}, of {span(w)}"
            return Realness("not PR", reason, _edge(w, real), math.nan)
        kind, sign = ("SPR", ">") if (real > 0).all() else ("PR", ">=")
        k = int(np.argmin(real))
        reason = (
            f"Re T(jw) {sign} 0 at all of {span(w)}; the least value is {real[k]:.4g} at "
            f"{w[k]:.6g} rad/s; outside them, and {BEYOND}"
        )
        return Realness(kind, reason, _edge(w, real), math.nan)


def _bands(w: np.ndarray, real: np.ndarray) -> str:
    bands, k = [], 0
    for below, group in groupby(real < 0):
        many = len([*group])
        if below:
            bands.append(f"from {w[k]:.6g} to {w[k + many - 1]:.6g} rad/s")
        k += many
    return " and ".join(bands)


def _edge(w: np.ndarray, real: np.ndarray) -> float:
    """Where Re T, linear in log w between the measured frequencies, first reaches 0."""
    if real[0] <= 0:
        return 0.0
    bad = np.flatnonzero(real <= 0)
    if not len(bad):
        return float(w[-1])
    return _between(w, real, int(bad[0]))


def _between(w: np.ndarray, values: np.ndarray, k: int) -> float:
    """The zero of values between w[k - 1] and w[k]."""
    part = values[k - 1] / (values[k - 1] - values[k])
    if w[k - 1] <= 0:
        return float(w[k - 1] + part * (w[k] - w[k - 1]))
    return float(w[k - 1] * (w[k] / w[k - 1]) ** part)


@dataclass(frozen=True)
class MeasuredLoop(Loop):
    """L(jw) at frequencies w in rad/s; ``open_poles``: its poles right of the axis, as declared."""

    w: np.ndarray
    L: np.ndarray
    open_poles: int
    border, alike = Axis(), LIKE_1

    @classmethod
    def of(cls, L: Any, open_poles: int) -> MeasuredLoop:
        """Raises InputError for a response that is not finite."""
        return cls(*response(L, "L"), open_poles)

    @property
    def basis(self) -> str:
        held = f"{self.open_poles or 'no'} pole{'s' * (self.open_poles != 1)}"
        return (
            f", of {span(self.w)}, if L has {held} right of the axis and no crossover beyond them"
        )

    @cached_property
    def _lines(self) -> tuple[np.ndarray, np.ndarray]:
        """log |L| and the phase in rad."""
        return np.log(np.maximum(np.abs(self.L), LEAST)), np.unwrap(np.angle(self.L))

    def _at(self, k: int, x: float) -> tuple[float, complex]:
        """w and L a part x of the way from point k to the next."""
        size, turned = (float(line[k] + x * (line[k + 1] - line[k])) for line in self._lines)
        low, high = float(self.w[k]), float(self.w[k + 1])
        w = low * (high / low) ** x if low > 0 else low + x * (high - low)
        return w, complex(math.exp(size) * complex(math.cos(turned), math.sin(turned)))

    @property
    def static(self) -> float:
        """L at the lowest frequency; nan where it is not real."""
        first = complex(self.L[0])
        return first.real if abs(first.imag) < LIKE_1 * abs(first) else math.nan

    @property
    def end(self) -> Margin:
        """The factor on L up to which the last |L| stays below 1."""
        size = float(abs(self.L[-1]))
        return Margin(1.0 / size if size else math.inf, float(self.w[-1]))

    def crossovers(self) -> list[tuple[float, complex]]:
        """Where |L| = 1, and L there."""
        return [self._at(k, x) for k, x in _through(self._lines[0], 0.0)]

    def real_crossings(self) -> list[tuple[float, float]]:
        """Where L is real and negative, and L there; below the band as it is continued."""
        found = [(w, L.real) for w, L, _ in self._half_turns()]
        late, rise = self._before()
        return found if rise or late.real >= 1 else [(0.0, late.real - 1), *found]

    def _half_turns(self) -> list[tuple[float, complex, int]]:
        """Where the phase goes through an odd multiple of 180 deg, and whether it rises (1)."""
        turned = self._lines[1]
        low, high = (math.floor((x / math.pi - 1) / 2) for x in (turned.min(), turned.max()))
        return [
            (*self._at(k, x), 1 if turned[k + 1] > turned[k] else -1)
            for m in range(low, high + 2)
            for k, x in _through(turned, (2 * m + 1) * math.pi)
        ]

    def disk(self, skew: int = 1) -> Margin:
        """1/max |S + (skew - 1)/2|, S = 1/(1 + L); skew 1: least |1 + L|."""

        def away(L: Any) -> Any:
            return np.abs((1 + L) / np.maximum(np.abs(1 + 0.5 * (skew - 1) * (1 + L)), LEAST))

        size, turned = self._lines
        x = np.linspace(0.0, 1.0, NEAR + 1)
        a, b = (line[:-1, None] + x * np.diff(line)[:, None] for line in (size, turned))
        every, found = away(np.exp(a + 1j * b)), [Margin(float(away(0.0)), math.inf)]
        for flat in np.argsort(every, axis=None)[: AMONG * NEAR]:
            k, i = divmod(int(flat), NEAR + 1)
            ends = (max(x[i] - 1 / NEAR, 0.0), min(x[i] + 1 / NEAR, 1.0))
            best: Any = minimize_scalar(
                lambda part, k=k: float(away(self._at(k, part)[1])),
                bounds=ends,
                method="bounded",
                options={"xatol": 1e-12},
            )
            for part in (float(best.x), *ends):
                w, value = self._at(k, part)
                found.append(Margin(float(away(value)), w))
        return min(found)

    def known(self, factors: list[float]) -> float:
        """The factor on L up to which ``factors`` are all that move it to -1: beyond the band |L|
        may be as large as at its end."""
        return self.end.value

    def unstable_poles(self, gain: float) -> float:
        """Poles of the loop with L times ``gain`` that are not stable; nan where it is open."""
        return MeasuredLoop(self.w, gain * self.L, self.open_poles).closed_poles

    @property
    def counts(self) -> tuple[float, float, float]:
        """Turns about -1, and poles of L and of the closed loop that are not stable."""
        return self.open_poles - self.closed_poles, self.open_poles, self.closed_poles

    @cached_property
    def closed_poles(self) -> float:
        """Of L/(1 + L), right of the imaginary axis, by Nyquist; nan where |L| ends above 1."""
        if abs(self.L[-1]) >= 1:
            return math.nan
        late, rise = self._before()
        # From w = 0 the short way to the first point; at the last, 1 + L goes the short way to 1.
        first = complex(1 + self.L[0])
        turned = _angle(first / late) - _angle(first)
        turned += 2 * math.pi * sum(way for _, L, way in self._half_turns() if L.real < -1)
        return round(self.open_poles + rise / 2 - turned / math.pi)

    def _before(self) -> tuple[complex, int]:
        """The direction of 1 + L as w goes to 0, and the number of integrators of L."""
        slope = 0.0
        if self.w[0] > 0:
            size = self._lines[0]
            slope = float((size[0] - size[1]) / math.log(self.w[1] / self.w[0]))
        rise = max(round(slope), 0)
        along = (-1j) ** rise
        sign = 1 if (self.L[0] / along).real >= 0 else -1
        return (along * sign if rise else complex(1 + sign * abs(self.L[0]))), rise

    @property
    def cause(self) -> str:
        """Why the closed loop is not stable; "" where it is."""
        if not self.closed_poles:
            return ""
        if math.isnan(self.closed_poles):
            return (
                f"this is not decided, |L| is {abs(self.L[-1]):.4g} at the highest frequency and "
                "must be below 1; measure up to higher ones"
            )
        many = f"{self.closed_poles:.0f} pole{'s' * (self.closed_poles != 1)}"
        return f"it has {many} right of the imaginary axis{self.basis}"


def _through(line: np.ndarray, level: float) -> list[tuple[int, float]]:
    """Where straight lines go through a level: the point before and the part of the way."""
    above = line >= level
    at = np.flatnonzero(above[1:] != above[:-1])
    return [(int(k), float((level - line[k]) / (line[k + 1] - line[k]))) for k in at]


def _angle(value: complex) -> float:
    return math.atan2(value.imag, value.real)
