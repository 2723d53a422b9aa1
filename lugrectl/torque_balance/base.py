"""The base row alone: the torque balance of the declared model, in a second."""

from __future__ import annotations

from collections.abc import Sequence

from ..blocks.model import Model
from ..estimates.balance import Balance
from ..record.stretches import Stretch
from .friction import View
from .interval import Interval, best_law
from .last_fit import LastFit, state_of
from .plain import plain_balance
from .table import Table
from .verdict import refuse_dead, seen


def base_row(stretches: Sequence[Stretch], model: Model) -> Balance:
    """The plain answer: what the declared model leaves free, by one regression; Refused where
    nothing moves, or the torque has nothing to do with the motion."""
    view, width = seen(stretches, model)
    refuse_dead(view, width)
    last = settled(view)
    interval = Interval(last)
    V = interval.covariance()
    return plain_balance(last, interval, interval.values(V), V, width.sure, stretches)


def settled(view: View) -> LastFit:
    """The declared model at its best friction law."""
    table = Table(view)
    return best_law(view, state_of(table), table.scale, straight=True)
