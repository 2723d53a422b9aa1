"""What a check is asked about, as one kind of system: exact, of many states, or measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby
from typing import Any

import control as ct
import numpy as np

from .border import Axis
from .exact_system import ExactSystem
from .state_system import StateSystem
from .transfer import is_measured, response, span
from .verdict import Falls, Realness

EXACT = 6  # states of a state-space model that is decided in exact arithmetic
LEAST = 1e-300
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
        return cls(*response(T, name))

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
        turns = 1 + np.flatnonzero((above[1:] < 0) != (above[:-1] < 0))
        found = tuple(_between(w, above, int(k)) for k in turns)
        return Falls(float(size[0]), found, min(found, default=math.inf), said, "")

    def realness(self) -> Realness:
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


System = ExactSystem | StateSystem | MeasuredSystem


def has_many_states(T: Any) -> bool:
    return isinstance(T, ct.StateSpace) and T.nstates > EXACT


def system_of(T: Any) -> System:
    """Return T of one input and output; InputError for what the checks do not take."""
    if is_measured(T):
        return MeasuredSystem.of(T)
    return StateSystem.single(T) if has_many_states(T) else ExactSystem.of(T)
