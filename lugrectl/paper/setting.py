"""The parts of a comparison: compensations, references, cases, studies. Data only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np
from scipy.signal import lfilter

PREFILTER = 2.0  # 1/s, the source paper's 2/(s + 2)


@dataclass(frozen=True)
class Compensation:
    """A friction compensation with its gains, or a controller without compensation.

    ``label`` names observer and gains, ``short`` is the column's heading; ``gains`` holds K1, K2,
    k of the observer, or kp, ki in place of those of the study's controller.
    """

    short: str
    label: str
    observer: str | None = None
    gains: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Reference:
    """A reference: ``kind`` "still", "sine" A sin(2 pi f t), "raised" A (1 - cos(2 pi f t)) or
    "step" A; A in rad/s or rad, f in Hz; ``prefilter``: filtered by 2/(s + 2)."""

    kind: str = "still"
    amplitude: float = 0.0
    hertz: float = 1.0
    prefilter: bool = False

    def inputs(self, t: np.ndarray, loop: str, feedforward: bool) -> np.ndarray:
        """(2, N): r, and its first (velocity) or second (position) derivative, or 0 for none.

        With the prefilter r' = 2 (c - r) and r'' = 2 c' - 4 (c - r), c the command.
        """
        r, first, second = self._command(t)
        if self.prefilter:
            command, pole = r, PREFILTER
            r = _filtered(t, command)
            first, second = pole * (command - r), pole * first - pole**2 * (command - r)
        rate = first if loop == "velocity" else second
        return np.array([r, rate if feedforward else 0.0 * t])

    def _command(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        a, w = self.amplitude, 2 * np.pi * self.hertz
        sin, cos = a * np.sin(w * t), a * np.cos(w * t)
        if self.kind == "sine":
            return sin, w * cos, -(w**2) * sin
        if self.kind == "raised":
            return a - cos, w * sin, w**2 * cos
        return (a if self.kind == "step" else 0.0) + 0.0 * t, 0.0 * t, 0.0 * t


def _filtered(t: np.ndarray, command: np.ndarray) -> np.ndarray:
    """The prefilter from rest, exact for a command that is linear between equidistant samples."""
    smooth: Any = ct.TransferFunction([PREFILTER], [1, PREFILTER])
    smooth = smooth.sample(t[1] - t[0], method="foh")
    b, a = smooth.num[0][0], smooth.den[0][0]
    b = np.r_[np.zeros(len(a) - len(b)), b]
    return np.asarray(lfilter(b, a, command, zi=[-b[0] * command[0]])[0])


@dataclass(frozen=True)
class Measure:
    """An RMS value: of "e", "w" or "F - Fhat", over a window in s."""

    signal: str
    unit: str
    window: tuple[float, float]


@dataclass(frozen=True)
class Case:
    """One simulation for each compensation, and the measures of it.

    ``scale``: factors on the observer's parameters, by name; ``start``: initial states by label
    (those of other observers are ignored); ``x``: abscissa in a sweep.
    """

    label: str
    reference: Reference
    measures: tuple[Measure, ...]
    scale: Mapping[str, float] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    feedforward: bool = False
    duration: float = 5.0
    dt: float = 1e-3
    x: float | None = None


@dataclass(frozen=True)
class Drawn:
    """The trace to draw: the case's number, its signal with unit, and the time shown in s.

    ``columns``: short names of the curves, all if empty; ``log``: magnitude, logarithmic.
    """

    case: int
    signal: str
    unit: str
    span: tuple[float, float]
    columns: tuple[str, ...] = ()
    log: bool = False


@dataclass(frozen=True)
class Study:
    """Cases and compensations: a table and a figure (a sweep's figure shows the table)."""

    key: str
    title: str
    scenario: str
    loop: str
    controller: Mapping[str, float]
    compensations: tuple[Compensation, ...]
    cases: tuple[Case, ...]
    drawn: Drawn | None = None
    ranked: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        return {
            "key": self.key,
            "title": self.title,
            "scenario": self.scenario,
            "loop": self.loop,
            "controller": dict(self.controller),
            "columns": [
                {"name": c.short, "label": c.label, "observer": c.observer, "gains": dict(c.gains)}
                for c in self.compensations
            ],
        }
