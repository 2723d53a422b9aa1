"""Systems and lists of continuous and sampled blocks as one net, and the times of its updates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..engine.runtime.course import Course
from ..engine.tracing.network import Net, Part
from . import arguments

MOST = 1e8  # updates in a run: an array of them is 0.8 GB
NEAR = 1e-6  # of the shortest sample time: updates and times closer than that are the same


def net_of(system: Any) -> tuple[Net, list[float]]:
    """The net of a system, or of a list of blocks with its sample times.

    InputError for an item that is not a block, two blocks of one name, or dt = True without a
    sample time.
    """
    if not isinstance(system, (list, tuple)):
        return Net.of(arguments.system(system)), []
    blocks = [arguments.system(b, "a block") for b in system]
    names = [b.name for b in blocks]
    twice = [k for k in names if names.count(k) > 1]
    if twice or not blocks:
        raise InputError(
            f"two blocks are called {twice[0]}: give one of them another name="
            if twice
            else "the list of blocks is empty."
        )
    rates = [_rate(b, blocks) for b in blocks]
    periods = sorted({rate for rate in rates if rate is not None})
    parts = [
        Part(
            block,
            tuple(block.input_labels),
            tuple(block.output_labels),
            None if rate is None else periods.index(rate),
        )
        for block, rate in zip(blocks, rates, strict=True)
    ]
    return Net("blocks", tuple(parts), outside(parts), len(periods)), periods


def _rate(block: Any, blocks: Sequence[Any]) -> float | None:
    """The sample time in s, None in continuous time; dt = True takes that of the others."""
    if not block.isdtime(strict=True):
        return None
    if block.dt is not True:
        return float(block.dt)
    known = {float(b.dt) for b in blocks if b.isdtime(strict=True) and b.dt is not True}
    if len(known) != 1:
        raise InputError(f"{block.name} has dt=True: give it a sample time in s.")
    return known.pop()


def outside(parts: Sequence[Part]) -> tuple[str, ...]:
    """Signals that a block reads and no block outputs, in the order in which they are read."""
    made = {k for part in parts for k in part.outputs}
    return tuple(dict.fromkeys(k for part in parts for k in part.inputs if k not in made))


def course_of(t: np.ndarray, u: np.ndarray, periods: Sequence[float], hold: bool) -> Course:
    """Updates at the multiples of each sample time, between the first and the last time."""
    near, updates = NEAR * min(periods), sum((t[-1] - t[0]) / dt for dt in periods)
    if updates > MOST:
        raise InputError(
            f"blocks with dt = {min(periods):g} s are updated {updates:.3g} times until "
            f"t = {t[-1]:g} s, more than {MOST:g}: is a time in ms?"
        )
    grid, ticks = t, []
    for dt in periods:
        first, last = np.ceil(t[0] / dt - NEAR), np.floor(t[-1] / dt + NEAR)
        ticks.append(dt * np.arange(first, last + 1))
        grid = _joined(grid, ticks[-1], near)
    flags = np.zeros((len(periods), len(grid)))
    for row, own in zip(flags, ticks, strict=True):
        row[_nearest(grid, own)] = 1.0
        row[0] = max(row[0], 0.5)  # before the first update: the output of the initial state
    column = np.full(len(grid), -1)
    column[_nearest(grid, t)] = np.arange(len(t))
    if hold:
        given = u[:, np.searchsorted(t, grid + near, side="right") - 1]
    else:
        given = np.array([np.interp(grid, t, row) for row in u]).reshape(len(u), len(grid))
    return Course(grid, given, flags, column, hold)


def _joined(grid: np.ndarray, more: np.ndarray, near: float) -> np.ndarray:
    """The grid, with the other times added that are not in it."""
    if not len(more):
        return grid
    new = more[np.abs(grid[_nearest(grid, more)] - more) > near]
    return np.sort(np.concatenate([grid, new]))


def _nearest(grid: np.ndarray, times: np.ndarray) -> np.ndarray:
    right = np.clip(np.searchsorted(grid, times), 1, max(len(grid) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(grid) - 1)
    return np.where(times - grid[left] <= grid[right] - times, left, right)
