"""The rests of a drive, and the peak of friction after each.

While the drive rests its level of static friction grows by c = 1 - exp(-t/tau). The bristle takes
that up over the presliding distance x0 and, once the drive slides, gives it back over the same:

    e' = (c sign(w) - e) |w| / x0,

with c = 0 while it slides. Rests are where the state of the block ``dwell_stiction`` grows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import REGISTRY
from ..regression.smooth_motion import Motion

FEWEST = 5  # rests: fewer do not show how a peak grows with their length
GONE = 8.0  # presliding distances after which nothing is left of a peak


@dataclass(frozen=True)
class Rest:
    """The samples of a rest, and of the slide after it."""

    still: slice
    after: slice


def rests_of(m: Motion, vs: float) -> list[Rest]:
    """Where the drive rests, by the Stribeck speed; empty where that is too seldom."""
    block = REGISTRY["effect", "dwell_stiction"]
    rate = block(m.w, np.zeros(len(m)), time_constant=1.0, vs=vs)[1]
    still, found = np.asarray(rate) > 0.5, []
    for p in m.pieces:
        edges = np.flatnonzero(np.diff(np.r_[0, still[p].astype(int), 0])) + p.start
        ends = [*edges[2::2].tolist(), *([p.stop] if len(edges) else [])]
        for first, end, stop in zip(edges[::2], edges[1::2], ends, strict=True):
            if p.start < first and end < stop:
                found.append(Rest(slice(int(first), int(end)), slice(int(end), int(stop))))
    return found if len(found) >= FEWEST else []


def peaks(m: Motion, x0: float, rests: Sequence[Rest], tau: float = 0.0) -> np.ndarray:
    """The excess of the bristle's torque (n,) over static friction, for a strength of 1.

    ``tau`` of 0: as large after each rest.
    """
    made = np.zeros(len(m))
    for rest in rests:
        theta, after = m.theta[rest.still], m.theta[rest.after]
        side = np.sign(after[-1] - theta[0])
        moved = np.maximum(side * theta - np.min(side * theta), 0.0)
        grown = 1.0 - np.exp(-np.arange(len(theta)) * m.dt / tau) if tau else 1.0
        made[rest.still] = side * grown * (1.0 - np.exp(-moved / x0))
        far = np.abs(after - theta[-1]) / x0
        made[rest.after] = made[rest.still][-1] * np.where(far < GONE, np.exp(-far), 0.0)
    return made
