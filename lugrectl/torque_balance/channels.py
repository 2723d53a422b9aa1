"""What the channels have that is none of the drive: u that was logged late, w that is not 0 at
rest. Each is a row of the table beside the base; a proven one is undone before anything is asked.

A bus or a filtered current makes u late. The base knows lateness as a slope du/dt, which is true
for a hold; where that reaches its bound, the column itself is tried earlier. Where w stands alone,
the place of the step of friction tells its offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..blocks.friction import free_level
from ..core.regression import Prior, log_density, paired, robust
from ..record import Stretch
from .constants import AT_REST, LATE_STEP, SCREEN, VERY_LATE, WHOLE
from .friction import View
from .search import Search, golden
from .table import Contender, Table, proven
from .unknown import Unknown

OFFSETS = np.geomspace(1e-3, 0.1, 21)  # of top speed, that are tried
NEAR_BY = 0.1  # of an offset: where its likelihood is compared
KEPT = 0.5  # of the inertia: what a u that is moved must leave of it
CURVE = 0.02  # of top speed: the Stribeck speed beside them


def logged_late(view: View, table: Table) -> float:
    """How late (s) u was logged; 0 where no such row of the table is the likeliest."""
    if not view.sure or table.fit.free[1] or table.fit.b[1] > 0:
        return 0.0
    m, grid = view.motion, np.arange(0.0, VERY_LATE, LATE_STEP)

    def row(T: float) -> Contender:
        made = Contender("late", {}, u=m.later(-T), cost=float(np.log(len(grid))))
        made.lateness = True
        return table.enter(made)

    def gain(T: float) -> float:
        made = row(T)  # of a u that is moved away from all motion nothing is left, nor of J
        return made.gain if made.J > KEPT * table.J else -np.inf

    best = float(grid[int(np.argmax([gain(T) for T in grid]))])
    best = golden(gain, max(best - LATE_STEP, 0.0), best + LATE_STEP)
    late = row(best)
    if best <= 0 or not proven(*paired(late.e, table.e)):
        return 0.0
    # a torque that is lost, or depends on the place, makes the rest late
    strange = Unknown(table, view.model.motion == "linear", True).rows()
    others = [c.gain for c in Search(table, True, (), {}).rows()]
    others += [table.enter(c).gain for c in strange if c.depends_on == {"theta"}]
    return best if late.gain > max(others, default=0.0) else 0.0


def speed_offset(view: View, table: Table) -> tuple[float, float]:
    """How much (rad/s) a w without theta is above the speed, with its standard error; 0 where no
    such row is proven."""
    m, v = view.motion, view
    if any(r.sensors.theta is not None for r in m.runs):
        return 0.0, 0.0
    X = np.column_stack([v.rows.a, v.late, v.K @ np.column_stack([m.w, np.ones(len(m))])])
    blurred = max(AT_REST * m.top, m.sensors.w_variance**0.5)

    @lru_cache
    def promise(offset: float) -> float:
        w = m.w - offset
        way = np.tanh(w / blurred)
        law = np.column_stack([way, way * free_level(w, 0.0, 1.0, CURVE * m.top, 1.0)])
        both = np.column_stack([X, v.K @ law])
        r = robust(both, v.y, Prior.free(both.shape[1]), table.scale).r
        return float(np.sum(log_density(r)))

    grid = np.r_[-OFFSETS[::-1], 0.0, OFFSETS] * m.top
    i = int(np.argmax([promise(x) for x in grid]))
    best = golden(promise, grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])
    if promise(best) - promise(0.0) < SCREEN:
        return 0.0, 0.0

    @lru_cache
    def scores(offset: float) -> np.ndarray:
        return Table(view.lowered(offset), table.scale).e

    def total(offset: float) -> float:
        return float(scores(offset).sum())

    best = golden(total, 0.5 * best, 1.5 * best, 11)
    e = scores(best) - np.log(len(grid)) / len(table.e)
    if not proven(*paired(e, table.e)):
        return 0.0, 0.0
    step = NEAR_BY * abs(best)
    up, down = scores(best + step), scores(best - step)
    bend = float(np.sum(2 * scores(best) - up - down)) / step**2
    error = WHOLE * np.linalg.norm(up - down) / (2 * step * bend)  # by what the blocks say alone
    error = float(error) if bend > 0 else abs(best)
    return best, float(np.hypot(error, blurred / np.sqrt(12.0)))  # slower is rest


def as_acted(stretches: Sequence[Stretch], late: float, above: float) -> list[Stretch]:
    """The stretches with each torque ``late`` (s) before it was logged, speeds less ``above``."""
    made = []
    for s in stretches:
        u, ok = np.interp(s.t + late, s.t, s.u), s.ok & (s.t + late <= s.t[-1])
        made.append(replace(s, u=u, ok=ok, w=None if s.w is None else s.w - above))
    return made
