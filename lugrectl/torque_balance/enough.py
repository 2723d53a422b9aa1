"""Enough of a long log: parts in which effects are searched and chosen; all of it gives the values.

What rows tell of a model grows with their number, what a search costs, too: beyond some minutes
more of the same motion decides nothing.
"""

from __future__ import annotations

import numpy as np

from .constants import BLOCK, ENOUGH, PARTS, STRANGE
from .friction import View
from .motion import Motion
from .rows import Rows
from .samples import SHORTEST
from .width import Width

SHORT = 30.0  # s: a log up to twice as long is searched as a whole
GOLDEN = 0.6180339887  # of a period: parts at equal distances take one frequency for another


def enough(view: View, width: Width) -> View:
    """The view of PARTS of a long log: evenly spread ones, and the STRANGE of which a plain balance
    leaves most, wherever something happens once. Itself where the log is short."""
    m = view.motion
    seconds = max(ENOUGH * m.dt, SHORT)
    if m.duration < 2 * seconds:
        return view
    length = seconds / PARTS
    chosen = np.zeros(int(m.duration / length) + 1, bool)
    chosen[_spread(len(chosen))] = True
    order = np.argsort(np.where(chosen, -1.0, _left(width, length, len(chosen))))
    chosen[order[-STRANGE:]] = True
    few = _only(m, chosen[(m.elapsed / length).astype(int)])
    return view.by(few, Rows(few, view.rows.h))


def _spread(number: int) -> np.ndarray:
    """Places of parts among so many, one in each of equal periods but not at equal distances."""
    i = np.arange(PARTS - STRANGE)
    return ((i + GOLDEN * i % 1.0) * number / len(i)).astype(int)


def _left(width: Width, length: float, number: int) -> np.ndarray:
    """What a plain balance leaves (number,) of each part: the mean square of its worst block."""
    block = (width.t / BLOCK).astype(int)
    many = np.maximum(np.bincount(block), 1)
    power = np.bincount(block, width.r**2) / many
    made = np.zeros(number)
    part = np.minimum((np.arange(len(power)) * BLOCK / length).astype(int), number - 1)
    np.maximum.at(made, part, power)
    return made


def _only(motion: Motion, here: np.ndarray) -> Motion:
    """The motion in the samples ``here`` (n,), cut where they do not go on."""
    runs = []
    for r, own in zip(motion.runs, motion.at, strict=True):
        at = []
        for piece in r.samples.pieces:
            change = np.flatnonzero(np.diff(here[own][piece])) + 1 + piece.start
            ends = [piece.start, *change.tolist(), piece.stop]
            at += [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)
                   if here[own][a] and b - a >= SHORTEST]  # fmt: skip
        runs += [r.only(at)] if at else []
    return Motion(runs)
