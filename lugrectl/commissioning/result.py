"""The answer: the response with its band, its modes, and whether friction governs the log."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from ..core.display import Row, between, noticed, number
from ..core.provenance import Provenance
from ..core.result import Result
from ..core.views import view
from .mechanics import Mechanics, Mode

LARGE = 2.0  # dB by which friction changes a response that it governs: no band holds there
CERTAIN = 0.95  # coherence below which nothing is certain
GOOD = "Friction changes the response below {:.3g} Hz by {:.1f} dB: the band holds."
BAD = (
    "Friction governs {} of {} points, {:.3g} to {:.3g} Hz: it changes the response by 2 dB or "
    "more there, and no band holds."
)
RECORD = (
    "Record 30 s of quick moves that mostly reverse, with a multisine on the speed reference whose "
    "torque is about twice the friction, and log the reference."
)
THIN = "Only {} of {} points are certain: elsewhere the log excites the axis too little."
UNSURE = (
    "{} of {} points of the response are not certain (coherence below 0.95, or friction governs)."
)
FEW = 0.5  # of the points: with fewer certain ones that is said
UNIT = {"rotary": "(rad/s)/(N m)", "linear": "(m/s)/N"}  # of a response


class UncertainResponseWarning(UserWarning):
    """A response is used at points that are not certain."""


@dataclass(eq=False, repr=False)
class FrequencyResponse(Result, ct.FrequencyResponseData):
    """The frequency response from motor torque less friction to motor speed.

    A ``control.FrequencyResponseData`` of all points, at the log's sample time: of a loop with the
    controller C, ``lg.stability_check(C * response)``, which warns of points that are not certain.

    Attributes
    ----------
    frd, raw : control.FrequencyResponseData
        The response with friction taken out, and without; (rad/s)/(N m), or (m/s)/N, at the log's
        sample time: the torque is held over each sample, and a dead time is part of it.
    frequency, magnitude, phase : ndarray
        In rad/s, as above, and rad (``unwrapped`` along what is certain).
    low, high : ndarray
        The 95 % band of the magnitude; NaN where nothing is certain.
    coherence : ndarray
        The share of the speed's power about each frequency that the response explains.
    correction : float
        By how many dB friction changes the response below 10 Hz, the median.
    governed : ndarray
        Whether friction changes the response about each frequency by 2 dB or more.
    trusted : bool
        Whether ``correction`` is below 2 dB, and any point certain.
    modes : tuple of Mode
        Antiresonances and resonances, ``frequency`` in rad/s, ``damping`` as a ratio, with 95 %
        intervals ``ci95`` and ``damping_ci95``.
    inertia : float or None
        In kg m2 or kg, of the whole axis; None where the log does not show it.
    inertia_ci95 : tuple of float or None
        Its 95 % interval.
    friction : dict
        Levels that were taken out, N m or N. Good for that; identify estimates them.
    reference : bool
        Whether a logged reference served as instrument.
    messages : tuple of str
        What was noticed, the verdict on friction first.
    mechanics : Mechanics or None
        The fitted model that inertia and modes are of; :func:`tune` reads it.
    gains : Tuning or None
        Of ``lugrectl bode --tune``.
    """

    frd: ct.FrequencyResponseData
    raw: ct.FrequencyResponseData
    unwrapped: np.ndarray
    low: np.ndarray
    high: np.ndarray
    coherence: np.ndarray
    correction: float
    governed: np.ndarray
    modes: tuple[Mode, ...] = ()
    inertia: float | None = None
    inertia_ci95: tuple[float, float] | None = None
    friction: Mapping[str, float] = field(default_factory=dict)
    reference: bool = False
    motion: str = "rotary"
    messages: tuple[str, ...] = ()
    mechanics: Mechanics | None = field(default=None, repr=False)
    gains: Any = None
    provenance: Provenance | None = field(default=None, repr=False)
    is_axis = True  # and no loop

    def __post_init__(self) -> None:
        ct.FrequencyResponseData.__init__(self, self.frd, sysname="axis")

    @property
    def frequency(self) -> np.ndarray:
        return self.omega

    @property
    def magnitude(self) -> np.ndarray:
        return np.abs(np.asarray(self.frdata)[0, 0])

    @property
    def phase(self) -> np.ndarray:
        return self.unwrapped

    def __str__(self) -> str:
        return repr(self)

    def __mul__(self, other: Any) -> Any:
        return self._used() * other

    def __rmul__(self, other: Any) -> Any:
        return other * self._used()

    def _used(self) -> ct.FrequencyResponseData:
        """All points, with a warning where some are not certain."""
        if unsure := int((~self.certain).sum()):
            said = UNSURE.format(unsure, len(self.omega))
            warnings.warn(said, UncertainResponseWarning, stacklevel=3)
        return self.frd

    @property
    def trusted(self) -> bool:
        return self.correction < LARGE and bool(self.certain.any())

    @property
    def certain(self) -> np.ndarray:
        """Where the coherence is at least 0.95, and friction does not govern."""
        return (self.coherence >= CERTAIN) & ~self.governed

    @property
    def raw_phase(self) -> np.ndarray:
        """The phase of ``raw`` in rad, within half a turn of ``phase``."""
        return self.phase + np.angle(np.ravel(self.raw.frdata) / np.ravel(self.frd.frdata))

    @property
    def unit(self) -> str:
        """Of the magnitude."""
        return UNIT[self.motion]

    def plot(self) -> Sequence[Any]:
        """Draw magnitude, phase and coherence, with the band; uncertain points are faint. With
        ``gains`` also Nyquist's curve and a step. Returns the Axes."""
        return view("check_plots.bode")(self)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document."""
        raw = np.asarray(self.raw.frdata)[0, 0]
        return {
            "schema": 1,
            "frequency": self.frequency,
            "magnitude": self.magnitude,
            "phase": self.phase,
            "low": self.low,
            "high": self.high,
            "coherence": self.coherence,
            "raw": {"magnitude": np.abs(raw), "phase": self.raw_phase},
            "correction": self.correction,
            "governed": self.governed,
            "trusted": self.trusted,
            "modes": [mode.summary() for mode in self.modes],
            "inertia": self.inertia,
            "inertia_ci95": self.inertia_ci95,
            "friction": dict(self.friction),
            "reference": self.reference,
            "gains": None if self.gains is None else self.gains.summary(),
            "messages": list(self.messages),
            "provenance": self.provenance.summary() if self.provenance else None,
        }

    def _title(self) -> str:
        sure, all_of = int(self.certain.sum()), len(self.frequency)
        f = self.frequency[[0, -1]] / (2.0 * np.pi)
        return f"Frequency response, {f[0]:.3g} to {f[1]:.4g} Hz: {sure} of {all_of} points certain"

    def _rows(self) -> Iterable[Row]:
        force, mass = ("N m", "kg m2") if self.motion == "rotary" else ("N", "kg")
        sizes = {"Fc": self.friction.get("Fc"), "load's Fc": self.friction.get("load Fc")}
        levels = ", ".join(f"{k} {number(v, 3)}" for k, v in sizes.items() if v)
        inertia = f"({between(self.inertia_ci95)})" if self.inertia_ci95 else ""
        return [
            *([Row("inertia", number(self.inertia), mass, inertia)] if self.inertia else []),
            *(Row(mode.kind, *_shown(mode)) for mode in self.modes),
            *([Row("taken out", levels, force)] if levels else []),
            *noticed(self.messages, "messages"),
        ]


def unwrapped(w: np.ndarray, P: np.ndarray, sure: np.ndarray) -> np.ndarray:
    """The phase, unwrapped along what is certain; the rest is within half a turn of that."""
    angle = np.angle(P)
    line = np.interp(w, w[sure], np.unwrap(angle[sure]))
    return line + np.angle(np.exp(1j * (angle - line)))


def _shown(mode: Mode) -> tuple[str, str, str]:
    low, high = (x / (2.0 * np.pi) for x in mode.ci95)
    hertz = f"({mode.frequency / (2.0 * np.pi):.4g} Hz, {low:.4g} to {high:.4g})"
    return f"{mode.frequency:.4g}", "rad/s", f"{hertz}, damping {mode.damping:.2g}"
