"""Results of the reproduction: small frozen objects, no drawing and no printing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ..model import Parameters
from ..provenance import Provenance
from ..results import plain
from .bench import Outcome, Trace


@dataclass(frozen=True)
class Width:
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


@dataclass(frozen=True)
class PaperFigure:
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


@dataclass(frozen=True)
class Growth:
    """Growth of the compensated position PI: predicted from its poles, and simulated.

    Time constants in s; ``observer`` and ``window`` (s) are those of the simulation.
    """

    predicted: float
    simulated: float
    observer: str
    window: tuple[float, float]

    def summary(self) -> dict[str, Any]:
        return asdict(self) | {"window": list(self.window)}


@dataclass(frozen=True)
class Reproduction:
    """Everything that ``lugrectl reproduce`` shows."""

    parameters: Parameters
    widths: tuple[Width, ...]
    figures: tuple[PaperFigure, ...]
    growth: Growth | None
    outcomes: tuple[Outcome, ...]
    provenance: Provenance | None = None

    def outcome(self, key: str) -> Outcome | None:
        """The outcome of a study, None if it was not run."""
        return next((o for o in self.outcomes if o.study.key == key), None)

    def figure(self, key: str) -> PaperFigure | None:
        """A figure of the source paper, "velocity" or "position"; None if it was not made."""
        return next((f for f in self.figures if f.key == key), None)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        from .wording import claims, slips

        return plain(
            {
                "schema": 1,
                "parameters": asdict(self.parameters),
                "bandwidths": [w.summary() for w in self.widths],
                "figures": [f.summary() for f in self.figures],
                "growth": self.growth.summary() if self.growth else None,
                "studies": [o.summary() for o in self.outcomes],
                "claims": [asdict(c) for c in claims(self)],
                "slips": list(slips()),
                "provenance": self.provenance.summary() if self.provenance else None,
            }
        )

    def to_json(self) -> str:
        """One JSON document (schema 1)."""
        return json.dumps(self.summary(), indent=2, allow_nan=False)

    def __str__(self) -> str:
        from .page import text

        return text(self)

    def _repr_html_(self) -> str:
        from .page import fragment

        return fragment(self)
