"""Loads behind a spring or a gap, driven by the measured motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...spec import Block
from .base import Base, Columns
from .contender import Entry
from .driven import torque_of_unit_load

SLOWEST, FASTEST = 4.0, 60.0  # Hz of a load on its spring
DAMPINGS = (0.03, 0.1, 0.3)
GAP_FREQUENCIES, GAP_DAMPING = (45.0, 80.0, 140.0), 0.3
GAPS = 90  # a gap that is 5 % off loses most of what it explains
NEAR = (0.96, 1.0, 1.04)  # of a gap that is known already
EDGE = 0.84  # of the slowest: below, it is an inertia that falls with frequency and no spring
CRITICAL = 0.95  # damping ratio
STEPS = (0.08, 0.3, 0.03)  # of the simplex, in logarithms
MOST_EVALUATIONS = 40


def springs(base: Base, block: Block) -> Iterator[Entry]:
    """The most likely frequency, damping and gap of an inertia of 1 behind it."""
    gapped = "gap" in block.own
    if "load_inertia" not in block.own or base.record.motion.dt > 0.02:
        return
    found = _gap(base, block) if gapped else _spring(base, block)
    if found is None:
        return
    (f, damping, gap), places = found
    if f < EDGE * SLOWEST or damping > CRITICAL:
        return
    made = Columns.free(_column(base, block, f, damping, gap)[:, None], 0.0)
    values = {"frequency": f, "damping_ratio": damping, "gap": gap}
    yield Entry(block.name, values, made, cost=float(np.log(places)), inertial=True)


def _column(base: Base, block: Block, f: float, damping: float, gap: float) -> np.ndarray:
    load = torque_of_unit_load(base.record.motion, block, f, damping, gap)
    return base.record.rows.narrow @ load


def _gain(base: Base, block: Block, f: float, damping: float, gap: float) -> float:
    if not 0.8 * SLOWEST < f < 400 or damping > 1:
        return -1.0
    gains, b = base.gains(_column(base, block, f, damping, gap)[:, None])
    return float(gains[0]) if b[0] > 0 else -1.0


def _spring(base: Base, block: Block) -> tuple[tuple[float, float, float], int] | None:
    from .search import simplex

    top = min(FASTEST, 0.3 / base.record.motion.dt)
    grid = [(float(f), z) for f in np.geomspace(SLOWEST, top, 22) for z in DAMPINGS]
    gains = [_gain(base, block, f, z, 0.0) for f, z in grid]
    if max(gains) < 0:
        return None
    start = np.log(grid[int(np.argmax(gains))])
    x = simplex(lambda p: _gain(base, block, *np.exp(p), 0.0), start, STEPS[:2], MOST_EVALUATIONS)
    f, z = np.exp(x).tolist()
    return (f, z, 0.0), len(grid)


def _gap(base: Base, block: Block) -> tuple[tuple[float, float, float], int] | None:
    from .search import simplex

    m, known = base.record.motion, base.gap
    if known:
        grid = [(known["frequency"], known["damping_ratio"], known["gap"] * x) for x in NEAR]
    else:
        reach = min(float(np.ptp(m.theta)), 2 * np.pi)
        gaps = 2 * np.geomspace(max(m.count, 4e-4 * reach), 0.04 * reach, GAPS)
        grid = [(f, GAP_DAMPING, float(g)) for f in GAP_FREQUENCIES for g in gaps]
    gains = [_gain(base, block, *one) for one in grid]
    if max(gains) < 0:
        return None
    start = np.log(grid[int(np.argmax(gains))])
    x = simplex(lambda p: _gain(base, block, *np.exp(p)), start, STEPS, MOST_EVALUATIONS)
    f, z, gap = np.exp(x).tolist()
    return (f, z, gap), len(GAP_FREQUENCIES) * GAPS
