"""The door: balance(stretches, model)."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...blocks.model import Model
from ...record.stretches import Stretch
from .answer import answer
from .coasting import UNIT_INERTIA, coasting
from .estimate import estimate
from .problem import Ground, ground_of
from .result import Balance
from .speed_offset import with_offset

SINGULAR = (
    "The terms of the balance cannot be separated on this record: its torque or its motion hardly "
    "changes."
)


def balance(
    stretches: Sequence[Stretch],
    model: Model,
    held: Mapping[str, float] | Sequence[str] = (),
) -> Balance:
    """The plain answer of a torque balance, for any log.

        u(t - T) = J a + Fc sign(w) + Fv w + constant + gravity(theta) + effects + residual

    in means over windows, by a robust regression whose columns have noise too.

    Parameters
    ----------
    stretches : sequence of Stretch
        The samples of one drive, from one log or several.
    model : Model
        Its motion, and its effects as further terms. Its values are not used, unless held.
    held : dict or list of str
        Parameters that are known: ``{"Fc": 0.2}``, or names whose values the model has.

    Returns
    -------
    Balance
        What cannot be answered is left out, and a note says why.
    """
    began = time.perf_counter()
    known = _held(model, held)
    with np.errstate(all="ignore"):  # a record without noise divides by nearly 0
        try:
            made = _of(stretches, model, known)
        except np.linalg.LinAlgError:
            made = Balance(notes=(SINGULAR,))
    return replace(made, seconds=time.perf_counter() - began)


def _of(stretches: Sequence[Stretch], model: Model, held: Mapping[str, float]) -> Balance:
    ground = ground_of(stretches, model, held)
    if isinstance(ground, Ground):
        return _answered(ground)
    if ground.torque == 0.0:
        per_inertia = ground_of(stretches, model, {**held, **UNIT_INERTIA})
        if isinstance(per_inertia, Ground) and not per_inertia.is_map:
            found = coasting(_answered(per_inertia), model.motion)
            if found is not None:
                return found
    return Balance(notes=ground.notes)


def _answered(ground: Ground) -> Balance:
    ground = with_offset(ground)
    found = estimate(ground)
    if found is None:
        reason = "The record is too short for one window of the balance, or u is 0 in all of it."
        return Balance(notes=(*ground.notes, reason), is_map=ground.is_map)
    return answer(ground, found)


def _held(model: Model, held: Mapping[str, float] | Sequence[str]) -> dict[str, float]:
    """The values that are known, under the names of the terms."""
    known = model.known()
    pairs = held if isinstance(held, Mapping) else {k: known[k] for k in held if k in known}
    constant = {
        f"{p.key}.torque": "constant_torque"
        for p in model.effects
        if p.block.name == "constant_torque"
    }
    return {constant.get(k, k): float(v) for k, v in pairs.items()}
