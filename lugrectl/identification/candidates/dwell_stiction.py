"""A stiction that grows with the length of a rest: a larger peak after a longer rest.

A peak of one size after each rest is a term of every base: the bristle of the table is coarse
there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...blocks.block import Block
from .base_model import LEVELS, Base, Columns
from .candidate import Entry
from .friction_terms import FORCES
from .rests import peaks, rests_of

CONSTANTS = 6  # time constants that are tried
SLOWEST, FASTEST = 3.0, 0.1  # of the longest rest, of the median one


def entries(base: Base, block: Block) -> Iterator[Entry]:
    """The effect at a few time constants, if the drive rests often enough."""
    m = base.record.motion
    rests = rests_of(m, base.law.vs)
    if not len(rests):
        return
    lasts = (rests.end - rests.first) * m.dt
    p = block.own[block.gain]
    for tau in np.geomspace(FASTEST * np.median(lasts), SLOWEST * lasts.max(), CONSTANTS).tolist():
        X = _static(base) * base.record.mean(peaks(m, base.law.x0, rests, tau))[:, None]
        cost = float(np.log(CONSTANTS))
        yield Entry(block.name, {"time_constant": tau}, Columns.free(X, p.low, p.high), cost=cost)


def _static(base: Base) -> float:
    """Level of static friction, N m."""
    return max(float(np.sum(base.made.b[LEVELS][: len(FORCES)])), 0.3 * base.friction_rms)
