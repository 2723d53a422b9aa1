"""The result of a comparison: verdict, table, budget, limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..core.result import Fields, plain


@dataclass(frozen=True)
class Share(Fields):
    """Where a part of the torque goes."""

    term: str
    rms: float  # N m
    share: float  # of the RMS friction torque, with its 95 % interval
    ci95: tuple[float, float] | None
    signals: tuple[str, ...]  # on which it depends


@dataclass(frozen=True)
class Compared(Fields):
    """A row of the table: how much better it predicts left-out blocks than the declared model."""

    model: str
    elpd: float  # log predictive density relative to it, nats, with its paired standard error
    se: float
    torque: float  # RMS of what it adds, as a share of friction
    parameters: int  # its free ones


@dataclass(frozen=True)
class Detectable(Fields):
    """The smallest share of friction at which an effect would have been seen.

    ``finest``: of waves over theta, those of an order (1/rev; rad/m on linear drives) up to this
    one; windows that average over noise hide finer ones. None for other effects.
    """

    name: str
    share: float
    finest: float | None = None


@dataclass(frozen=True)
class Comparison:
    """What the table says of a record.

    ``rows`` are the models that were compared, ``budget`` says where the torque goes,
    ``detectable`` how small an effect would have been seen. ``least`` is the smallest torque that
    matters, as a share of ``friction``, the RMS friction torque (N m). ``stretches`` counts the
    independent parts of the motion that were compared; None if that is not known.
    """

    verdict: str
    rows: tuple[Compared, ...] = ()
    budget: tuple[Share, ...] = ()
    detectable: tuple[Detectable, ...] = ()
    least: float = 0.0
    friction: float = 0.0
    stretches: int | None = None

    def summary(self) -> dict[str, Any]:
        """Its keys of the JSON document."""
        limits = self.detectable if self.verdict == "adequate" else None
        return plain({"budget": self.budget, "comparison": self.rows, "detectable": limits})
