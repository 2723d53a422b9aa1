"""The result of a comparison: verdict, table, budget, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .values import Valued


@dataclass(frozen=True)
class Share:
    """Where a part of the torque goes.

    ``rms`` in N m, ``share`` of the RMS friction torque with its 95 % interval, ``signals`` on
    which it depends.
    """

    term: str
    rms: float
    share: float
    ci95: tuple[float, float] | None
    signals: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        own = {"term": self.term, "rms": self.rms, "share": self.share}
        return own | {"ci95": self.ci95 and list(self.ci95), "signals": list(self.signals)}


@dataclass(frozen=True)
class Compared:
    """A row of the table: how much better it predicts left-out blocks than the declared model.

    ``elpd``: log predictive density relative to it, nats, with its paired standard error ``se``.
    ``torque``: RMS of what it adds, as a share of friction. ``parameters``: its free ones.
    """

    model: str
    elpd: float
    se: float
    torque: float
    parameters: int

    def summary(self) -> dict[str, Any]:
        keys = ("model", "elpd", "se", "torque", "parameters")
        return {k: getattr(self, k) for k in keys}


@dataclass(frozen=True)
class Detectable:
    """The smallest share of friction at which an effect would have been seen."""

    name: str
    share: float

    def summary(self) -> dict[str, Any]:
        return {"name": self.name, "share": self.share}


@dataclass(frozen=True)
class Named:
    """An effect that the table names, with values to start a fit from.

    ``zeros`` are the shifts of theta (rad), by run, with which it has one phase in all runs. Of an
    effect with rivals, ``weight`` is its part in the mixture that predicts left-out blocks best; of
    a rival, ``valued`` are the values of the model that has it.
    """

    name: str
    values: Mapping[str, float]
    share: float
    zeros: Mapping[int, float] = field(default_factory=dict)
    weight: float = 1.0
    valued: Valued | None = None


def place_of(effects: Sequence[Named]) -> int:
    """The place of the effect that has rivals: gravity that joined the base has none."""
    return len(effects) - 1 if effects[0].name == "gravity" else 0


@dataclass(frozen=True)
class Comparison:
    """What the table says of a record.

    ``effects`` are named, the largest first; ``alternatives`` explain the record as well as the
    first of them. ``depends_on`` are the signals of an unknown torque. ``plant`` are inertia and
    friction beside the effects, ``alone`` those of the declared model without them: start values.
    ``only_inertia``: of the effects the record shows no more than the inertia of a load. ``events``
    are the times (s) of torques that nothing in the table predicts. ``swings``: the frequency (Hz)
    of an unknown torque that is a wave in time; None if it is none. ``written_late``: by how much
    the torque was written down after the motion (s). ``stretches`` counts the independent parts of
    the motion that were compared; None if that is not known. ``valued`` are the values of the model
    with the effects, with their covariance, ``friction`` is the RMS friction torque (N m).
    """

    verdict: str
    effects: tuple[Named, ...] = ()
    alternatives: tuple[Named, ...] = ()
    depends_on: tuple[str, ...] = ()
    rows: tuple[Compared, ...] = ()
    budget: tuple[Share, ...] = ()
    detectable: tuple[Detectable, ...] = ()
    messages: tuple[str, ...] = ()
    plant: Mapping[str, float] = field(default_factory=dict)
    alone: Mapping[str, float] = field(default_factory=dict)
    least: float = 0.0
    only_inertia: bool = False
    events: tuple[float, ...] = ()
    swings: float | None = None
    written_late: float = 0.0
    seconds: float = 0.0
    stretches: int | None = None
    valued: Valued | None = None
    friction: float = 0.0
