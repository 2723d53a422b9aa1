"""Values of declared effects that the model leaves open, from the table's own search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...blocks.model import Model, Part
from ...record.stretches import Stretch
from ..balance import Balance
from ..candidates.base_model import WEIGHT
from ..candidates.candidate import Contender, enter
from ..candidates.friction_shape import settled
from ..candidates.search import entries
from ..candidates.start_values import values_of
from .compare import answered, record_of


def completed(stretches: Sequence[Stretch], model: Model, plain: Balance) -> dict[str, float]:
    """The values of declared effects that the model leaves open, by key; {} if none fits."""
    found: dict[str, float] = {}
    for part in model.effects if answered(plain) else ():
        if None in part.values.values():
            with np.errstate(all="ignore"):  # a record without noise divides by nearly 0
                found |= _of(part, stretches, model, plain)
    return found


def _of(part: Part, stretches: Sequence[Stretch], model: Model, plain: Balance) -> dict[str, float]:
    others = tuple(p for p in model.effects if p is not part and None not in p.values.values())
    record = record_of(stretches, replace(model, effects=others), plain)
    if len(record.rows) < WEIGHT:  # fewer than it has terms
        return {}
    base = settled(record)
    tried = [enter(base, entry) for entry in entries(base, part.block)]
    best: Contender | None = max(tried, key=lambda c: c.gain, default=None)
    if best is None:
        return {}
    values = values_of(best, model)
    own = part.block.own
    return {
        f"{part.key}.{k}": float(np.clip(v, own[k].low, own[k].high))
        for k, v in values.items()
        if part.values.get(k) is None
    }
