"""Events: torque at a few instants that no model of the table predicts.

What happens once cannot be predicted from the rest of a record, so no row of the table shows it.
It stands in the residual all the same, far beyond what the residual is elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..candidates.base_model import Base, rms
from ..regression.numbers import BEYOND, TAKEN

APART = 0.3  # s between two events
SHOWN = 3  # events whose times are given
SMALL = 0.05  # of the energy of all: a smaller one is not counted
SAID = (
    "At {} a torque of up to {:.3g} {} acts for {:.2g} s in all that nothing in the comparison "
    "predicts."
)


@dataclass(frozen=True, eq=False)
class Events:
    """The RMS torque of all events over that of friction, their times (s), peak and duration, and
    the rows of the table in which they are."""

    share: float
    times: tuple[float, ...]
    peak: float
    lasts: float
    rows: np.ndarray

    @property
    def returns(self) -> bool:
        """Whether it is more than one incident."""
        return len(self.times) > 1

    def sentence(self, unit: str) -> str:
        """Where and how large they are."""
        at = [f"{t:.3g}" for t in self.times[:SHOWN]]
        many = len(self.times) - SHOWN
        where = f"t = {', '.join(at)} s" + (f" and {many} more instants" if many > 0 else "")
        return SAID.format(where, self.peak, unit, self.lasts)


def explained(odd: Events, base: Base, r: np.ndarray) -> bool:
    """Whether a model with the residuals ``r`` leaves next to nothing of the events."""
    at = np.isin(np.arange(len(r)), odd.rows)
    left = rms(np.where(at, r * base.view.scale.sigma, 0.0)) / base.friction_rms
    return left < TAKEN * odd.share


def events(base: Base) -> Events:
    """What a base leaves at a few instants."""
    e, rows = np.abs(base.made.r * base.view.scale.sigma), base.record.rows
    far = e > BEYOND * np.median(e)
    if not far.any():
        return Events(0.0, (), 0.0, 0.0, np.zeros(0, int))
    each = np.split(np.flatnonzero(far), np.flatnonzero(np.diff(rows.t[far]) > APART) + 1)
    energy = [float(np.sum(e[at] ** 2)) for at in each]
    large = [each[i] for i in np.argsort(energy)[::-1] if energy[i] > SMALL * sum(energy)]
    times = tuple(float(rows.t[at[np.argmax(e[at])]]) for at in large)
    share = rms(np.where(far, e, 0.0)) / base.friction_rms
    return Events(share, times, float(e.max()), float(far.sum() * rows.step), np.flatnonzero(far))
