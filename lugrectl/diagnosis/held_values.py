"""Held and bounded values that a log contradicts by far, found by the plain torque balance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..core.display import with_interval
from ..estimates.findings import Estimate
from ..identification.balance import Balance, balance
from ..identification.balance.result import LEVELS
from ..record import Stretch

OFF = 1.5  # times another value: farther than a missing effect takes the balance
SHARE = 0.05  # of the torque that such a value must leave more ...
HALF = 0.5  # ... and from which nothing can be answered with it
SAYS = (
    "{0} is {1} {2:.6g}{3}, but this log says {4}{3} ({5}): correct the value or its unit, or let "
    "it be fitted."
)


@dataclass(frozen=True, eq=False)
class Against:
    """Sentences on contradicted values, whether the log can be answered with them at all, and the
    balance without what the model holds."""

    said: tuple[str, ...]
    hopeless: bool
    free: Balance


def against_stated(parts: Sequence[Stretch], model: Model, found: Balance) -> Against | None:
    """Which held or bounded values the log contradicts; None if it contradicts none.

    ``found`` is the balance with the held values.
    """
    stated = {k for k, s in model.stated.items() if s.fixed or s.bounded}
    keys = [k for k in stated if not model.declarations()[k].angle]
    if not keys:
        return None
    free = balance(parts, model) if model.held() else found
    if free.refused or free.left is None or free.left > HALF:
        return None  # the log itself is at fault
    said, most = [], 0.0
    for key in sorted(keys):
        e = free.parameters.get(key)
        value = None if e is None else _allowed(key, e, model)
        if e is None or value is None or not _far(value, e):
            continue
        left = _left(parts, model, key, value - e.value, value)
        if left > free.left + SHARE:
            said.append(_sentence(key, value, e, model))
            most = max(most, left)
    return Against(tuple(said), most > HALF, free) if said else None


def _allowed(key: str, e: Estimate, model: Model) -> float | None:
    """The value of the model that is nearest to the log's."""
    stated = model.stated[key]
    return model.values()[key] if stated.fixed else stated.clipped(e.value)


def _far(value: float, e: Estimate) -> bool:
    if e.ci95 is None or e.ci95[0] <= value <= e.ci95[1]:
        return False
    low, high = sorted((abs(value), abs(e.value)))
    return high > OFF * low or value * e.value < 0


def _left(parts: Sequence[Stretch], model: Model, key: str, change: float, value: float) -> float:
    """What the balance leaves with this value, as a share of the RMS torque; 0 if unknown."""
    if key in LEVELS:
        return balance(parts, model, {key: value}).left or 0.0
    if model.unit(key) != unit_for("N m", model.motion):
        return 0.0
    size = np.sqrt(np.nanmean(np.concatenate([np.asarray(p.u) ** 2 for p in parts])))
    return float(abs(change) / np.sqrt(2.0) / size)


def _sentence(key: str, value: float, e: Estimate, model: Model) -> str:
    """ "J is held at 22 kg m2, but this log says 0.0022 kg m2 (0.0021 to 0.0023): ..." """
    stated = model.stated[key]
    how = "held at" if stated.fixed else "at least" if value > e.value else "at most"
    unit = model.unit(key)
    return SAYS.format(key, how, value, "" if unit == "1" else f" {unit}", *with_interval(e))
