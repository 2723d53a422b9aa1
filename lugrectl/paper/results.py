"""Results of the reproduction: small frozen objects, no drawing and no printing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..blocks.model import Parameters
from ..core.display import Row, Shown
from ..core.provenance import Provenance
from ..core.result import Result, plain
from ..core.views import view
from ..report.wording import number
from .bench import Outcome, Trace
from .equations import PAPER

HOLDS, FAILS = "holds", "does not hold"
SMALL = 1e-6  # a smaller value counts as 0


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
        values = asdict(self) | {"poles": [[q.real, q.imag] for q in self.poles]}
        return values | {"gains": dict(self.gains)}


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
        return {
            "key": self.key,
            "scenario": self.scenario,
            "unit": self.unit,
            "window": list(self.window),
            "rms": dict(self.errors),
        }


@dataclass(frozen=True, repr=False)
class Growth(Shown):
    """Growth of the compensated position PI: predicted from its poles, and simulated.

    Time constants in s; ``observer`` and ``window`` (s) are those of the simulation.
    """

    predicted: float
    simulated: float
    observer: str
    window: tuple[float, float]

    def summary(self) -> dict[str, Any]:
        return asdict(self) | {"window": list(self.window)}


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

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        return plain(
            {
                "schema": 1,
                "parameters": asdict(self.parameters),
                "bandwidths": [w.summary() for w in self.widths],
                "figures": [f.summary() for f in self.figures],
                "growth": self.growth.summary() if self.growth else None,
                "studies": [o.summary() for o in self.outcomes],
                "claims": [asdict(c) for c in self.claims],
                "slips": list(slips()),
                "provenance": self.provenance.summary() if self.provenance else None,
            }
        )

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


@dataclass(frozen=True)
class Claim:
    """A statement of the source paper, what was found, and whether it holds."""

    paper: str
    found: str
    status: str


def slips() -> tuple[dict[str, str], ...]:
    """Labels of the paper that do not hold as printed: label, status, note."""
    return tuple(
        {"label": p.label, "status": p.status, "note": p.note} for p in PAPER if p.status != HOLDS
    )


def width_of(r: Reproduction, loop: str, label: str, level: str = "-3dB") -> Width:
    return next(w for w in r.widths if (w.loop, w.label, w.level) == (loop, label, level))


def milli(value: float) -> str:
    """A value in thousandths, three digits; "diverges" for infinity."""
    if not math.isfinite(value):
        return "diverges"
    if value < SMALL:
        return "<0.001"
    value *= 1e3
    return number(value, 3 if value >= 0.1 else 2)
