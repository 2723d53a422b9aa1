"""Results of the reproduction: small frozen objects, no drawing and no printing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..blocks.model import Parameters
from ..core.display import Row, Shown, number
from ..core.provenance import Provenance
from ..core.result import Fields, Result, picked, plain
from ..core.views import view
from .equations import FAILS, HOLDS, PAPER
from .studies import Measure, Study

SMALL = 1e-6  # a smaller RMS value counts as 0


@dataclass(frozen=True, repr=False)
class Trace(Shown):
    """One signal of one compensation over time, for a figure."""

    name: str
    t: np.ndarray
    y: np.ndarray


@dataclass(frozen=True)
class Errors:
    """RMS values of one measure, one for each compensation; inf if the loop diverged."""

    label: str
    measure: Measure
    rms: Mapping[str, float]
    x: float | None = None

    def summary(self) -> dict[str, Any]:
        """Return what the JSON document has of it."""
        return {"case": self.label, **plain(asdict(self.measure)), "rms": plain(self.rms)}


@dataclass(frozen=True, repr=False)
class Outcome(Shown):
    """The result of a study: rows of RMS values, and the traces of its figure."""

    study: Study
    rows: tuple[Errors, ...]
    traces: tuple[Trace, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Return what the JSON document has of it."""
        return self.study.summary() | {"rows": plain(self.rows)}


@dataclass(frozen=True, repr=False)
class Width(Shown):
    """Bandwidth of one loop, r to w or theta, with all friction or all but Fv compensated.

    ``spr``: class of the loop's T(s), the existing observer's condition; None if it does not
    apply. Hz and 1/s.
    """

    loop: str
    label: str
    gains: Mapping[str, float]
    level: str
    hertz: float
    stable: bool
    poles: tuple[complex, ...]
    spr: str | None
    paper: str

    def summary(self) -> dict[str, Any]:
        """Return what the JSON document has of it."""
        return plain(asdict(self) | {"poles": [[q.real, q.imag] for q in self.poles]})


@dataclass(frozen=True, repr=False)
class PaperFigure(Shown):
    """A figure of the source paper: reference, and the response of three loops."""

    key: str
    scenario: str
    unit: str
    window: tuple[float, float]
    reference: Trace
    responses: tuple[Trace, ...]
    errors: Mapping[str, float]

    def summary(self) -> dict[str, Any]:
        """Return what the JSON document has of it."""
        return picked(self, "key scenario unit window") | {"rms": plain(self.errors)}


@dataclass(frozen=True, repr=False)
class Growth(Shown, Fields):
    """Growth of the compensated position PI: predicted from its poles, and simulated.

    Time constants in s; ``observer`` and ``window`` (s) are those of the simulation.
    """

    predicted: float
    simulated: float
    observer: str
    window: tuple[float, float]


@dataclass(frozen=True)
class Claim(Fields):
    """A statement of the source paper, what was found, and whether it holds."""

    paper: str
    found: str
    status: str


@dataclass(frozen=True, repr=False)
class Reproduction(Result):
    """Everything that ``lugrectl reproduce`` shows."""

    parameters: Parameters
    widths: tuple[Width, ...]
    figures: tuple[PaperFigure, ...]
    growth: Growth | None
    outcomes: tuple[Outcome, ...]
    claims: tuple[Claim, ...] = ()
    provenance: Provenance | None = None

    def outcome(self, key: str) -> Outcome | None:
        """The outcome of a study, None if it was not run."""
        return next((o for o in self.outcomes if o.study.key == key), None)

    def figure(self, key: str) -> PaperFigure | None:
        """A figure of the source paper, "velocity" or "position"; None if it was not made."""
        return next((f for f in self.figures if f.key == key), None)

    def _width(self, loop: str, label: str, level: str = "-3dB") -> Width:
        """The bandwidth of a loop by its label."""
        wanted = (loop, label, level)
        return next(w for w in self.widths if (w.loop, w.label, w.level) == wanted)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        return {
            "schema": 1,
            "parameters": asdict(self.parameters),
            "bandwidths": plain(self.widths),
            "figures": plain(self.figures),
            "growth": plain(self.growth),
            "studies": plain(self.outcomes),
            "claims": plain(self.claims),
            "slips": [picked(p, "label status note") for p in PAPER if p.status != HOLDS],
            "provenance": plain(self.provenance),
        }

    def save(self, folder: str | Path) -> list[Path]:
        """Write reproduce.html and reproduce.json into a folder, both or none; returns the paths.

        Raises InputError when the folder cannot be written.
        """
        return view("page.write", "paper")(self, folder)

    def _title(self) -> str:
        return "Reproduction of the source paper"

    def _rows(self) -> Iterable[Row]:
        return [
            *(Row(f"bandwidth, {w.label}", w.hertz, "Hz") for w in self.widths),
            Row("figures", ", ".join(f.key for f in self.figures)),
            Row("studies", ", ".join(o.study.key for o in self.outcomes)),
        ]

    def __str__(self) -> str:
        return view("page.text", "paper")(self)

    def _repr_html_(self) -> str:
        return view("page.fragment", "paper")(self)


def milli(value: float) -> str:
    """A value in thousandths, three digits; "diverges" for infinity."""
    if not np.isfinite(value):
        return "diverges"
    if value < SMALL:
        return "<0.001"
    value *= 1e3
    return number(value, 3 if value >= 0.1 else 2)


def claims(r: Reproduction) -> tuple[Claim, ...]:
    """The statements of the paper that can be checked by simulation, and what was found."""
    return (*_of_bandwidths(r), *_of_figures(r))


def _of_bandwidths(r: Reproduction) -> Iterator[Claim]:
    v, half = (r._width("velocity", "paper's PI", level) for level in ("-3dB", "half-power"))
    left = r._width("velocity", "paper's PI, Fv left in")
    yield Claim(
        "Velocity PI: around 115 Hz at -3 dB",
        f"{v.hertz:.1f} Hz (half power {half.hertz:.1f} Hz; Fv left in {left.hertz:.1f} Hz)",
        HOLDS,
    )
    pi, left = (r._width("position", f"paper's PI{x}") for x in ("", ", Fv left in"))
    yield Claim(
        "Position PI: approximately 20 Hz",
        f"|T| crosses -3 dB at {pi.hertz:.1f} Hz, but the loop is unstable and has no bandwidth; "
        f"stable with Fv left uncompensated (Fv Kp > J Ki, {left.hertz:.1f} Hz)",
        FAILS,
    )


def _of_figures(r: Reproduction) -> Iterator[Claim]:
    errors = {f.key: [milli(value) for value in f.errors.values()] for f in r.figures}
    if "velocity" in errors:
        _, none, best = errors["velocity"]
        yield Claim(
            "Velocity: friction degrades the PI severely, the proposed observer is a remedy",
            f"{none} against {best} mrad/s RMS, with exact observer parameters, where the "
            "natural observer does the same; with wrong ones see the tables",
            HOLDS,
        )
    if "position" in errors:
        _, none, best = errors["position"]
        yield Claim(
            "Position: the proposed observer performs well",
            f"{best} mrad RMS over 1 to 5 s, {none} with no observer (step of 1 rad, "
            "prefilter, exact parameters); later it grows without bound",
            FAILS,
        )
    if g := r.growth:
        yield Claim(
            "(not in the paper) growth of the compensated position loop",
            f"time constant {g.predicted:.2f} s from the poles, {g.simulated:.2f} s in simulation "
            f"over {g.window[0]:g} to {g.window[1]:g} s with the {g.observer}",
            "unstable",
        )
