"""The stretches of a log on which a model is run, and fewer or coarser ones of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np


@dataclass(frozen=True)
class Windows:
    """Stretches of equal length: each starts at ``start``, counts after ``burn`` samples.

    ``hidden``: where the states that the motion does not tell are at some of the starts, as
    parts of their reach.
    """

    start: np.ndarray
    burn: int
    length: int
    hidden: Mapping[int, np.ndarray] = field(default_factory=dict)

    @property
    def counted(self) -> np.ndarray:
        """Sample indices that count, (windows, length)."""
        return self.start[:, None] + self.burn + np.arange(self.length)


def windows(blocks: Sequence[tuple[int, int]], burn: int, length: int) -> Windows:
    """Cut blocks into windows; the burn-in lies inside the block, so that blocks share nothing."""
    starts: list[int] = []
    for a, b in blocks:
        starts += range(a, b - burn - length + 1, length)
    return Windows(np.array(starts, dtype=int), burn, length)


def spread(where: Windows, most: int, least: int) -> Windows:
    """Evenly spread ones of them, so many that ``most`` samples count, but at least ``least``."""
    kept = max(least, most // where.length)
    if len(where.start) <= kept:
        return where
    chosen = np.linspace(0, len(where.start) - 1, kept).round().astype(int)
    return replace(where, start=where.start[chosen])


def coarser(where: Windows, runs: Sequence[tuple[int, int]], every: int) -> Windows:
    """The same stretches where only every so many samples are left."""
    burn, length = -(-where.burn // every), where.length // every
    starts, base = [], 0
    for a, b in runs:
        own = where.start[(where.start >= a) & (where.start < b)]
        count = (b - a) // every
        moved = np.minimum(-(-(own - a) // every), count - burn - length)
        starts.append(base + moved[moved >= 0])
        base += count
    return Windows(np.concatenate(starts), burn, length)
