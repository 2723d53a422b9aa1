"""The declared model without a search: its plain answer, and all of its values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..core.errors import Refused
from ..estimates.balance import Balance, Combination
from ..record.stretches import Stretch
from .constants import FLOOR
from .friction import View
from .held_out import Split, Unseen
from .interval import Interval, best_law, other_views
from .last_fit import LastFit, state_of
from .plain import plain_balance
from .table import Table
from .verdict import COASTS, Answer, refuse_dead, seen

TURNED = "u has the wrong sign: it opposes the motion. These values are those of -u."
MISSING = (
    "Torque of {:.2g} % of friction stays that the declared model does not explain: values may be "
    "wrong by more than their intervals. A diagnosis says what is missing."
)


def base_row(stretches: Sequence[Stretch], model: Model) -> Balance:
    """The plain answer: what the declared model leaves free, by one regression; Refused where
    nothing moves, or the torque has nothing to do with the motion."""
    view, _, width, table = seen(stretches, model)
    if view.backward:
        made = base_row([replace(s, u=-s.u) for s in stretches], model)
        return replace(made, notes=(TURNED, *made.notes))
    if not np.any(view.motion.u) and model.J is None and not view.is_map:
        return _per_inertia(stretches, model)
    refuse_dead(view, width)
    if view.motion.one_way and "Fc" in view.declared:  # as a J that the log does not tell
        view.model = model.fix("Fc")
    last = settled(view, table)
    interval = Interval(last)
    V = interval.covariance() + interval.between(other_views(last))
    made = plain_balance(last, interval, interval.values(V), V, width.sure, stretches)
    return replace(made, notes=(*made.notes, *_missing(last)))


def _missing(last: LastFit) -> list[str]:
    """A sentence where torque stays for longer than a window: no interval knows of its cause."""
    view = last.view
    stays = Unseen.left(last.left, view.rows).stays / view.size
    return [] if view.is_map or stays < 2 * FLOOR else [MISSING.format(100 * stays)]


def _per_inertia(stretches: Sequence[Stretch], model: Model) -> Balance:
    """What a drive that coasts tells without its inertia: friction over it."""
    made = base_row(stretches, replace(model, J=1.0))
    sums, parts = [], made.parameters
    for key, unit in (("Fc", "rad/s2"), ("Fv", "1/s")):
        if key in parts:
            e, unit = parts[key], unit_for(unit, model.motion)
            sums.append(Combination(f"{key} / J", e.value, unit, e.ci95, "declare J", {}))
    if not sums:
        raise Refused(*COASTS)
    return replace(made, parameters={}, uncertain={}, combinations=tuple(sums), curve=(), names=(),
                   covariance=np.zeros((0, 0)), notes=(" ".join(COASTS),))  # fmt: skip


def settled(view: View, table: Table | None = None) -> LastFit:
    """The declared model at its best friction law; ``table`` is one of this view."""
    table = table if table is not None and table.view is view else Table(view)
    assert table.scale is not None  # the table has been settled
    return best_law(view, state_of(table).copy(constant=True), table.scale, straight=True)


def alone(
    stretches: Sequence[Stretch], model: Model, held_out: Sequence[tuple[int, float, float]] = ()
) -> Answer:
    """The values of the declared structure by all rows, its errors on held-out ones; Refused where
    nothing can be learnt. Friction's shape is settled on training rows."""
    view, _, width, _ = seen(stretches, model)
    refuse_dead(view, width)
    split = Split.of(view, held_out)
    train, test = view.on(split.train), view.on(split.test)
    trained = settled(train)
    for other in (view, test):
        other.settle_as(train)
    last = LastFit(view, trained.state.copy(), trained.scale)
    interval = Interval(last)
    V = interval.covariance() + interval.between(other_views(last))
    last.state.apply(view)
    left = Unseen.of(trained, test)
    return Answer(
        "identified", None, view, split, last, interval, interval.values(V), V, left, left,
        notes=_missing(last), refitted=trained, trained=trained,
    )  # fmt: skip
