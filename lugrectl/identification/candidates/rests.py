"""The rests of a drive, and the peak of friction after each.

While the drive rests its level of static friction grows by c = 1 - exp(-t/tau). The bristle takes
that up over the presliding distance x0 and, once the drive slides, gives it back over the same:

    e' = (c sign(w) - e) |w| / x0,

with c = 0 while it slides. Rests are where the state of the block ``dwell_stiction`` grows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...blocks.block import REGISTRY
from ..regression.smooth_motion import Motion

FEWEST = 5  # rests: fewer do not show how a peak grows with their length


@dataclass(frozen=True, eq=False)
class Rests:
    """The samples ``first`` to ``end`` of each rest, and those to ``stop`` of the slide after."""

    first: np.ndarray
    end: np.ndarray
    stop: np.ndarray

    def __len__(self) -> int:
        return len(self.first)


def rests_of(m: Motion, vs: float) -> Rests:
    """Where the drive rests, by the Stribeck speed; empty where that is too seldom."""
    block = REGISTRY["effect", "dwell_stiction"]
    rate = block(m.w, np.zeros(len(m)), time_constant=1.0, vs=vs)[1]
    still, found = np.asarray(rate) > 0.5, []
    for p in m.pieces:
        edges = np.flatnonzero(np.diff(np.r_[0, still[p].astype(int), 0])) + p.start
        each = np.stack(
            [edges[::2], edges[1::2], np.append(edges[2::2], p.stop)[: len(edges) // 2]]
        )
        found.append(each[:, (p.start < each[0]) & (each[1] < each[2])])
    made = np.concatenate(found, axis=1)
    return Rests(*(made if made.shape[1] >= FEWEST else made[:, :0]))


def peaks(m: Motion, x0: float, rests: Rests, tau: float = 0.0) -> np.ndarray:
    """The excess of the bristle's torque (n,) over static friction, for a strength of 1.

    ``tau`` of 0: as large after each rest.
    """
    made, theta = np.zeros(len(m)), m.theta
    if not len(rests):
        return made
    side = np.sign(theta[rests.stop - 1] - theta[rests.first])
    at, each, starts = _samples(rests.first, rests.end)
    path = side[each] * theta[at]
    moved = path - np.minimum.reduceat(path, starts)[each]
    grown = 1.0 - np.exp(-(at - rests.first[each]) * m.dt / tau) if tau else 1.0
    made[at] = side[each] * grown * (1.0 - np.exp(-moved / x0))
    at, each, _ = _samples(rests.end, rests.stop)
    before = rests.end[each] - 1
    made[at] = made[before] * np.exp(-np.abs(theta[at] - theta[before]) / x0)
    return made


def _samples(first: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The samples of all stretches, to which of them each belongs, and where each begins."""
    each = np.repeat(np.arange(len(first)), end - first)
    begun = np.append(0, np.cumsum(end - first)[:-1])
    return np.arange(len(each)) - begun[each] + first[each], each, begun
