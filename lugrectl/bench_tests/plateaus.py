"""Plateaus: parts of a log in which the axis keeps its speed, however slow beside its top speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .motion import Motion

BLOCK = 0.1  # s, over which a speed is taken
MOST = 3000  # blocks of a log
KEEPS = 0.06  # of its speed, within which a plateau keeps it
NOISE = 3.0  # standard deviations of the noise that are allowed beside it
FEWEST = 4  # blocks
SETTLING = 0.3  # of a plateau, at its start, in which the loop settles
STEADY = 0.008  # of its speed, by which the halves of a plateau may differ
SWINGS = 1.2  # standard deviations of the noise, by which the angle leaves a line
LEVEL = 1.12  # ratio of two speeds that are two


@dataclass(frozen=True, eq=False)
class Plateau:
    """Rows ``at`` of a motion at the mean speed ``w``, out of ``rows`` before it had settled."""

    motion: Motion
    at: slice
    w: float
    rows: int

    @property
    def error(self) -> float:
        """The standard deviation of w by the noise of the motion."""
        n = self.at.stop - self.at.start
        if self.motion.w is not None:
            return self.motion.noise / np.sqrt(n)
        return self.motion.noise * np.sqrt(2) / (n * self.motion.dt)

    @property
    def swings(self) -> bool:
        """Whether the axis sticks and slips: more than noise leaves the straight line."""
        one, t = self.motion, self.motion.t[self.at]
        if one.w is not None:
            return bool(np.std(one.w[self.at]) > SWINGS * one.noise)
        x = one.x[self.at]
        off = x - np.polyval(np.polyfit(t - t[0], x - x[0], 1), t - t[0])
        return bool(np.std(off) > SWINGS * one.noise)


def plateaus(one: Motion) -> tuple[list[Plateau], int]:
    """The plateaus of a motion, and the rows in which the axis moves."""
    size = max(int(BLOCK / one.dt), len(one) // MOST, 5)
    b, noise = _speeds(one, size)
    if len(b) < FEWEST:
        return [], 0
    made, k = [], 0
    while k + FEWEST <= len(b):
        end = _end(b, k, noise)
        if end - k >= FEWEST:
            made += _settled(one, k, end, size)
        k = end if end - k >= FEWEST else k + 1
    return made, int(np.count_nonzero(np.abs(b) > NOISE * noise)) * size


def _speeds(one: Motion, size: int) -> tuple[np.ndarray, float]:
    """Mean speeds of blocks, and the standard deviation of their noise."""
    many = len(one) // size
    if one.w is not None:
        w = np.where(one.stale, 0.0, one.w)[: many * size].reshape(many, size).mean(1)
        return w, one.noise / np.sqrt(size)
    x = one.x[np.arange(many + 1) * size - (np.arange(many + 1) * size >= len(one))]
    return np.diff(x) / (size * one.dt), one.noise * np.sqrt(2) / (size * one.dt)


def _end(b: np.ndarray, k: int, noise: float) -> int:
    """The first block after k whose speed is another than that of the blocks before."""
    total, j = b[k], k + 1
    while j < len(b):
        mean = total / (j - k)
        if abs(b[j] - mean) > KEEPS * abs(mean) + NOISE * noise:
            break
        total, j = total + b[j], j + 1
    return j


def _settled(one: Motion, k: int, end: int, size: int) -> list[Plateau]:
    """The plateau of some blocks without the rows in which its speed settles; none of a rest."""
    first = k + max(int(np.ceil(SETTLING * (end - k))), 1)
    at = slice(first * size, max(end - 1, first + 1) * size)
    x, t = one.x[at], one.t[at]
    w = float((x[-1] - x[0]) / (t[-1] - t[0]))
    found = Plateau(one, at, w, (end - k) * size)
    middle = len(x) // 2
    later = float((x[-1] - x[middle]) / (t[-1] - t[middle]))
    steady = abs(later - w) < 0.5 * STEADY * abs(w) + 2 * NOISE * found.error
    return [found] if steady and abs(w) > 2 * NOISE * found.error else []


def levels(w: np.ndarray) -> int:
    """How many sizes of speed differ."""
    sizes = np.sort(np.abs(w))
    return 1 + int(np.sum(np.diff(np.log(sizes)) > np.log(LEVEL)))
