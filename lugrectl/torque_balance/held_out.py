"""Rows that no step of a fit or a choice sees, and what models leave on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.errors import Refused
from ..core.numeric import rms
from ..core.regression import log_density, paired, spread
from .constants import BLOCK, LEAST_ROWS
from .friction import View
from .last_fit import Design, LastFit
from .windows import Rows

PART = 2.0  # s: length of alternate parts
PARTS = 40  # of a log at least: both kinds see every place and speed
LONGER = 6.0  # windows reach: a part is so many times as long
TOO_FEW = "the runs at steady speed are too few to fit some and to judge on others."
MORE = "Record at least three speeds in each direction."
LASTS = 3.0  # windows reach: two would be one bad sample
AGAIN = 6  # stretches that are far off: bad samples are fewer
OUTLIER = 10.0  # robust standard deviations beyond which a row counts no more


@dataclass(frozen=True, eq=False)
class Split:
    """Rows to fit and choose on, and rows to judge on: masks (m,) that share no sample."""

    train: np.ndarray
    test: np.ndarray

    @classmethod
    def of(cls, view: View, held_out: Sequence[Any] = ()) -> Split:
        """``held_out``: (run, start, end), s; none: every other part, or third run of a map."""
        rows, m = view.rows, view.motion
        t, run = m.stamp[rows.at], m.run[rows.at]
        held_out = held_out if len(held_out) else view.held_out
        if not len(held_out) and view.is_map:
            raise Refused(TOO_FEW, MORE)
        if not len(held_out):
            return cls._alternate(rows)
        train, test = np.ones(len(rows), bool), np.zeros(len(rows), bool)
        for own, start, end in held_out:
            here = run == own
            test |= here & (t >= start + rows.reach) & (t <= end - rows.reach)
            train &= ~(here & (t >= start - rows.reach) & (t <= end + rows.reach))
        enough = train.sum() >= 2 * LEAST_ROWS and test.sum() >= LEAST_ROWS
        return cls(train, test) if view.is_map or enough else cls._alternate(rows)

    @classmethod
    def _alternate(cls, rows: Rows) -> Split:
        length = min(PART, max((rows.t[-1] - rows.t[0]) / PARTS, LONGER * rows.reach))
        place = rows.t / max(length, 1e-12)
        odd = place.astype(int) % 2 == 1
        edge = np.abs(place - np.round(place)) * length < min(rows.reach, 0.1 * length)
        return cls(~odd & ~edge, odd & ~edge)


@dataclass(frozen=True, eq=False)
class Unseen:
    """What a fit to other rows leaves on held-out rows: ``r`` (m,) at ``t`` (m,), N m."""

    r: np.ndarray
    t: np.ndarray
    error: float  # its RMS
    stays: float  # RMS of what lasts longer than a window: torque that nothing explains

    @classmethod
    def of(cls, last: LastFit, test: View) -> Unseen:
        """``last`` is a fit to other rows of the same log."""
        design = Design(test, last.state)
        return cls.left(design.y - design.X @ last.fit.b, test.rows)

    @classmethod
    def left(cls, r: np.ndarray, rows: Rows) -> Unseen:
        r = np.clip(r, -_far(r), _far(r))
        return cls(r, rows.t, rms(r), structured(r, rows.t, rows.step, rows.h))


def gain(without: Unseen, other: Unseen, duration: float) -> float:
    """By how many standard errors ``other`` predicts held-out stretches better, by log density."""
    stretch = (without.t / max(BLOCK, duration / 60)).astype(int)
    there = np.bincount(stretch) > 0
    scale = spread(other.r) + 1e-300
    both = [np.bincount(stretch, log_density(one.r / scale))[there] for one in (other, without)]
    total, error = paired(*both)
    return total / error


def _far(r: np.ndarray) -> float:
    """From where on a row is far off, and counts no more."""
    return OUTLIER * spread(r) + 1e-300


def lasting(r: np.ndarray, rows: Rows) -> float:
    """RMS over all rows of those that are far off: for longer than the windows around one bad
    sample are (contacts, bursts), or again and again (an impact at each reversal). The largest
    stretch of them is left out: what is there once decides nothing."""
    off = np.flatnonzero(np.abs(r) > _far(r))
    t, size = rows.t[off], r[off] ** 2
    ends = [0, *(np.flatnonzero(np.diff(t) > 2 * rows.step) + 1).tolist(), len(off)]
    every = [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True) if b > a]
    if len(every) < AGAIN:
        every = [at for at in every if t[at.stop - 1] - t[at.start] > LASTS * rows.reach]
    power = [float(size[at].sum()) for at in every]
    return float(np.sqrt((sum(power) - max(power, default=0.0)) / len(r)))


def structured(r: np.ndarray, t: np.ndarray, step: float, h: float) -> float:
    """RMS of what of a residual lasts longer than a window, by its correlation beyond one."""
    first, found = max(4, int(np.ceil(2 * h / max(step, 1e-9)))), 0.0
    for k in {first, int(1.5 * first), 2 * first, 3 * first}:
        if len(r) < 4 * k:
            continue
        lag = t[k:] - t[:-k]
        c = (r[k:] * r[:-k])[np.abs(lag - np.median(lag)) < 0.5 * step]
        if len(c) > 8:
            found = max(found, abs(float(np.mean(c))) - 2 * float(np.mean(r * r)) / np.sqrt(len(c)))
    return float(np.sqrt(max(found, 0.0)))
