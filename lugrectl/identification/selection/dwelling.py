"""A stiction that grows with the length of a rest, as a column: a peak after each rest.

While the drive rests its level of static friction grows by c = 1 - exp(-t/tau). The bristle takes
that up over the presliding distance x0 and, once the drive slides, gives it back over the same:

    e' = (c sign(w) - e) |w| / x0,

with c = 0 while it slides. Rests are where the block says that its state grows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...spec import Block
from .base import LEVELS, Base, Columns
from .contender import Entry
from .law import FORCES

FEWEST = 5  # rests: fewer do not show how the peak grows with their length
CONSTANTS = 6  # time constants that are tried
SLOWEST, FASTEST = 3.0, 0.1  # of the longest rest, of the median one
GONE = 8.0  # presliding distances after which nothing is left


@dataclass(frozen=True)
class _Rest:
    """Samples of a rest, and of the slide after it."""

    still: slice
    after: slice


def entries(base: Base, block: Block) -> Iterator[Entry]:
    """The effect at a few time constants, if the drive rests often enough."""
    rests = list(_rests(base, block))
    if len(rests) < FEWEST:
        return
    dt = base.record.motion.dt
    lasts = np.array([(r.still.stop - r.still.start) * dt for r in rests])
    grid = np.geomspace(FASTEST * np.median(lasts), SLOWEST * lasts.max(), CONSTANTS)
    p = block.own[block.gain]
    for tau in grid:
        peaks = base.record.mean(_peaks(base, rests, float(tau)))[:, None]
        own = Columns.free(_static(base) * peaks, p.low, p.high)
        yield Entry(block.name, {"time_constant": float(tau)}, own, cost=float(np.log(CONSTANTS)))


def _static(base: Base) -> float:
    """Level of static friction, N m."""
    return max(float(np.sum(base.made.b[LEVELS][: len(FORCES)])), 0.3 * base.friction_rms)


def _rests(base: Base, block: Block) -> Iterator[_Rest]:
    m = base.record.motion
    rate = block(m.w, np.zeros(len(m)), time_constant=1.0, vs=base.law.vs)[1]
    still = np.asarray(rate) > 0.5
    for p in m.pieces:
        edges = np.flatnonzero(np.diff(np.r_[0, still[p].astype(int), 0])) + p.start
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            later = edges[edges > end]
            stop = int(later[0]) if len(later) else p.stop
            if p.start < first and end < p.stop:
                yield _Rest(slice(int(first), int(end)), slice(int(end), stop))


def _peaks(base: Base, rests: list[_Rest], tau: float) -> np.ndarray:
    """The excess of the bristle's torque (n,), over static friction, for a strength of 1."""
    m, x0 = base.record.motion, base.law.x0
    made = np.zeros(len(m))
    for rest in rests:
        theta, after = m.theta[rest.still], m.theta[rest.after]
        side = np.sign(after[-1] - theta[0])
        moved = np.maximum(side * (theta - np.min(side * theta) * side), 0.0)
        grown = 1.0 - np.exp(-np.arange(len(theta)) * m.dt / tau)
        made[rest.still] = side * grown * (1.0 - np.exp(-moved / x0))
        gone = np.exp(-np.minimum(np.abs(after - theta[-1]) / x0, GONE))
        made[rest.after] = made[rest.still][-1] * np.where(gone > np.exp(-GONE), gone, 0.0)
    return made
