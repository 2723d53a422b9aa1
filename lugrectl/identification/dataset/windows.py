"""Estimation windows (multiple shooting): stretches of a log on which a model is run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

SLIDES = 0.01  # of the largest speed; above this a drive certainly slides
LEAST_MOTION = 0.1  # of a window in motion


@dataclass(frozen=True)
class Windows:
    """Stretches of equal length: each starts at ``start`` and counts after ``burn`` samples."""

    start: np.ndarray
    burn: int
    length: int

    @property
    def counted(self) -> np.ndarray:
        """Sample indices that count, (windows, length)."""
        return self.start[:, None] + self.burn + np.arange(self.length)


def windows(blocks: Sequence[tuple[int, int]], burn: int, length: int) -> Windows:
    """Cut blocks into windows. The burn-in is inside the block, so blocks share no samples."""
    starts: list[int] = []
    for a, b in blocks:
        starts += range(a, b - burn - length + 1, length)
    return Windows(np.array(starts, dtype=int), burn, length)


def sliding(w: np.ndarray) -> np.ndarray:
    """Where a drive of speed w (N,) certainly slides, (N,) bool."""
    return np.abs(w) > SLIDES * np.max(np.abs(w))


def in_motion(where: Windows, w: np.ndarray) -> Windows:
    """Those in which the drive, of speed w (N,), moves: a rest says nothing of what moves it, and
    the noise of its torque is another one. All of them where it never does."""
    moved = np.mean(sliding(w)[where.counted], axis=1) > LEAST_MOTION
    return replace(where, start=where.start[moved]) if moved.any() else where


def spread(where: Windows, most: int, least: int) -> Windows:
    """Evenly spread windows, as many as have ``most`` counted samples, but at least ``least``."""
    kept = max(least, most // where.length)
    if len(where.start) <= kept:
        return where
    chosen = np.linspace(0, len(where.start) - 1, kept).round().astype(int)
    return replace(where, start=where.start[chosen])


def coarser(where: Windows, runs: Sequence[tuple[int, int]], every: int) -> Windows:
    """The same stretches in data of which only every ``every``-th sample is kept."""
    burn, length = -(-where.burn // every), where.length // every
    starts, base = [], 0
    for a, b in runs:
        own = where.start[(where.start >= a) & (where.start < b)]
        count = (b - a) // every
        moved = np.minimum(-(-(own - a) // every), count - burn - length)
        starts.append(base + moved[moved >= 0])
        base += count
    return Windows(np.concatenate(starts), burn, length)
