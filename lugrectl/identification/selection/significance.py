"""What a row of the table must gain to count: more than chance gives the best of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..candidates.candidate import Contender
from ..regression.numbers import MORE
from .table import Table


@dataclass(frozen=True)
class Bars:
    """The least share of friction that matters, and standard errors that chance does not reach."""

    least: float
    z: float

    def proven(self, table: Table, contenders: Sequence[Contender]) -> list[Contender]:
        """Those better than the base by more than the choice among so many may give."""
        bar = bar_of(table.named)
        above = [(c, *c.above(table.base)) for c in contenders]
        return [c for c, d, se in above if d > bar and d > self.z * se]

    def open_in(self, table: Table) -> float:
        """Nats of a torque that matters and stays unexplained: models may well differ as much."""
        large = [c for c in table.unknown if c.share > self.least]
        return max((c.gain for c in self.proven(table, large)), default=0.0)


def bar_of(choice: Sequence[object]) -> float:
    """Nats that the best of a choice may gain by chance."""
    return float(np.log(max(len(choice), 1))) + MORE
