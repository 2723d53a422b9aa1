"""Signals at one instant as numbers, by calling the blocks' own functions.

python-control passes through an interconnection once for each block and then reports an
algebraic loop; a chain through several channels of one block needs more passes, and a loop that
is linear has an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse.csgraph import connected_components

from .instant import LEAST, Unsolved

Step = Callable[[np.ndarray], np.ndarray]
SIZES = 10.0 ** np.arange(-6.0, 7.0, 1.5)  # of the points at which a loop must be linear
CLOSE = 1e-9
TRIES = 50  # pieces that are entered on the way to the solution
PIECE = 1e-7  # of the size of a point: a slope is taken over this


def settled_values(
    step: Step,
    start: np.ndarray,
    owners: Sequence[int],
    loops: dict[int, np.ndarray] | None = None,
    key: int = 0,
) -> np.ndarray:
    """The inputs v of all blocks for which step(v) = v.

    Parameters
    ----------
    step : callable
        The inputs that follow from the outputs of the blocks at the given inputs.
    start : (m,) ndarray
        Where to begin.
    owners : (m,) list of int
        The block of each input.
    loops, key : dict, int
        Remembers the inputs of a loop that was found to be linear, so that the next instant
        need not look for it.

    Returns
    -------
    (m,) ndarray
        With a value that is not finite, as soon as one occurs.

    Raises
    ------
    Unsolved
        For a loop that is not linear, or that has no or more than one solution; names blocks.
    """
    loops = {} if loops is None else loops
    if key in loops:
        found = _solved(step, start, loops[key], False)
        found = _by_newton(step, start, loops[key], False) if found is None else found
        if found is not None:
            return found
    values = _passed(step, start)
    if values is not None:
        return values
    loop = np.array(_looped(step, start), dtype=int)
    found = _solved(step, start, loop, True) if len(loop) else None
    if found is None and len(loop):
        found = _by_newton(step, start, loop, True)
    if found is None:
        raise Unsolved(sorted({owners[k] for k in loop}))
    loops[key] = loop
    return found


def _passed(step: Step, values: np.ndarray) -> np.ndarray | None:
    """The values after as many passes as there are values; None if they still change.

    The first passes give blocks zeros that the system never has: what is not finite may pass.
    """
    for _ in range(len(values) + 2):
        new = step(values)
        if np.array_equal(new, values, equal_nan=True):
            return new
        values = new
    return None if np.isfinite(values).all() else values


def _looped(step: Step, values: np.ndarray) -> list[int]:
    """The inputs that depend on themselves, seen by a small and a large change of each."""
    base, many = step(values), len(values)
    reach = np.zeros((many, many))
    for k in range(many):
        for size in (1e-3, 1.7e3):
            moved = values.copy()
            moved[k] += size
            reach[k, step(moved) != base] = 1
    _, group = connected_components(reach, connection="strong")
    sizes = np.bincount(group)
    return [k for k in range(many) if reach[k, k] or sizes[group[k]] > 1]


def _solved(step: Step, start: np.ndarray, loop: np.ndarray, new: bool) -> np.ndarray | None:
    """The values where those in the loop are equal to what follows from them.

    None if the loop has no or more than one solution; of a ``new`` one also if it is not linear.
    """
    opened, follows = _cut(step, start, loop)
    base = follows(np.zeros(len(loop)))
    slope = np.column_stack([follows(unit) - base for unit in np.eye(len(loop))])
    divisor = np.eye(len(loop)) - slope
    if not np.isfinite(slope).all() or np.linalg.cond(divisor) > 1.0 / LEAST:
        return None
    if new and not _linear(follows, base, slope):
        return None
    values = opened(np.linalg.solve(divisor, base))
    return values if _same(step(values), values) else None


def _by_newton(step: Step, start: np.ndarray, loop: np.ndarray, new: bool) -> np.ndarray | None:
    """The same for a loop through clips, which is linear piece by piece."""
    opened, follows = _cut(step, start, loop)
    eye, own = np.eye(len(loop)), np.zeros(len(loop))

    def slope(at: np.ndarray) -> np.ndarray:
        size = PIECE * max(1.0, np.abs(at).max())
        return np.column_stack([follows(at + size * k) - follows(at) for k in eye]) / size

    for _ in range(TRIES):
        values = opened(own)
        if _same(step(values), values):
            return values if not new or _pieces(follows, slope, len(loop)) else None
        own = own + np.linalg.lstsq(eye - slope(own), follows(own) - own)[0]
    return None


def _pieces(follows: Step, slope: Step, many: int) -> bool:
    """Whether it is linear about most points, with determinants of one sign: one solution."""
    random, signs, linear = np.random.default_rng(0), set(), []
    for size in np.repeat(SIZES, 4):
        at = size * random.standard_normal(many)
        step = 0.01 * size * random.standard_normal(many)
        a, b, c = follows(at - step), follows(at), follows(at + step)
        linear.append(np.allclose(a + c, 2.0 * b, rtol=1e-9, atol=1e-12 * size))
        signs.add(np.sign(np.linalg.det(np.eye(many) - slope(at))))
    return len(signs) == 1 and 0.0 not in signs and bool(np.mean(linear) > 0.8)


def _cut(step: Step, start: np.ndarray, loop: np.ndarray) -> tuple[Step, Step]:
    """All values when those in the loop are given, and what follows from these for the loop."""

    def opened(own: np.ndarray) -> np.ndarray:
        """All values when those in the loop are given, which follow from nothing then."""

        def clamped(values: np.ndarray) -> np.ndarray:
            changed = step(values)
            changed[loop] = own
            return changed

        begin = start.copy()
        begin[loop] = own
        values = _passed(clamped, begin)
        return np.full(len(start), np.nan) if values is None else values

    def follows(own: np.ndarray) -> np.ndarray:
        return step(opened(own))[loop]

    return opened, follows


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.all(np.abs(one - other) <= CLOSE * (1e-300 + np.abs(other).max())))


def _linear(follows: Step, base: np.ndarray, slope: np.ndarray) -> bool:
    random = np.random.default_rng(0)
    for size in np.repeat(SIZES, 2):
        some = size * random.standard_normal(len(base))
        for point in (some, -some):
            found, expected = follows(point), base + slope @ point
            scale = np.abs(base).max() + (np.abs(slope) @ np.abs(point)).max()
            if not np.all(np.abs(found - expected) <= CLOSE * scale):
                return False
    return True
