"""The bristle along a measured motion: Dahl's law with a given motion, in closed form.

    z' = (G sign(w) - z) |w| / (G x0)

Between two reversals it relaxes exponentially over the path. This is the small-damping limit of
:func:`lugrectl.blocks.friction.bristle` at a constant level G, in units of that level.
"""

from __future__ import annotations

import numpy as np


def strokes(dx: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The path, and the first sample and the direction of each stroke between reversals.

    ``dx`` (n,) are the steps, or the speeds at even times; the path has their unit. A step of 0
    is rest.
    """
    path, side = np.cumsum(np.abs(dx)), np.sign(dx)
    moving = np.flatnonzero(side)
    if not len(moving):
        return path, moving, side[:0]
    turns = side[moving[1:]] != side[moving[:-1]]
    first = moving[np.append(True, turns)]
    return path, first, side[first]


def along(
    path: np.ndarray, first: np.ndarray, sides: np.ndarray, x0: float, asymmetry: float = 0.0
) -> np.ndarray:
    """z (n,) for a level G of 1, or of 1 + asymmetry sign(w), from strokes as :func:`strokes` has
    them.

    The level is both the value towards which z relaxes and, as the stiffness stays, a factor on the
    distance x0 (in the unit of the path) over which it does.
    """
    if not len(first):  # a drive that never moves
        return np.zeros(len(path))
    level = 1.0 + asymmetry * sides
    start, limit = np.where(first > 0, path[first - 1], 0.0), sides * level
    ends = np.append(first[1:], len(path))
    decay = np.exp(-(path[ends - 1] - start) / (level * x0))
    last, before = [], 0.0
    for to, left in zip(limit.tolist(), decay.tolist(), strict=True):
        last.append(before)
        before = to + (before - to) * left
    each = np.repeat(np.arange(len(first)), ends - first)
    gone = np.exp(-(path[first[0] :] - start[each]) / (level * x0)[each])
    z = limit[each] + (np.array(last) - limit)[each] * gone
    return np.concatenate([np.zeros(first[0]), z])
