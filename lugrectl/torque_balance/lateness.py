"""A torque that was logged late: each row holds the torque that acted some time before.

A bus or a filtered current does so. The base knows lateness as a slope du/dt, which is true for a
hold; where that reaches its bound, the column itself is tried earlier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..core.regression import paired
from ..record.stretches import Stretch
from .constants import LATE_STEP, VERY_LATE
from .friction import View
from .search import golden
from .table import Contender, Table, proven



def logged_late(view: View) -> float:
    """How late (s) u was logged; 0 where no such row of the table is proven."""
    if not view.sure or np.ptp(view.motion.u) == 0:
        return 0.0
    table = Table(view)
    if table.fit.free[1] or table.fit.b[1] > 0:
        return 0.0
    m, grid = view.motion, np.arange(0.0, VERY_LATE, LATE_STEP)

    def row(T: float) -> Contender:
        u = np.interp(m.t + T, m.t, m.u)
        made = Contender("late", {}, u=u, cost=float(np.log(len(grid))))
        made.lateness = True
        return table.enter(made)

    best = float(grid[int(np.argmax([row(T).gain for T in grid]))])
    best = golden(lambda T: row(T).gain, max(best - LATE_STEP, 0.0), best + LATE_STEP)
    return best if proven(*paired(row(best).e, table.e)) else 0.0


def as_acted(stretches: Sequence[Stretch], T: float) -> list[Stretch]:
    """The stretches with each torque where it acted, T (s) before it was logged."""
    made = []
    for s in stretches:
        u, there = np.interp(s.t + T, s.t, s.u), s.t + T <= s.t[-1]
        made.append(replace(s, u=u, ok=s.ok & there))
    return made
