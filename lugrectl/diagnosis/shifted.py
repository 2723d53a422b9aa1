"""Records whose torque column is late against the motion, as the torque balance found it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..identification.balance import Balance
from ..record import Record

DELAY = "u_delay"
FEWEST = 12  # samples of a piece


def in_time(record: Record, plain: Balance) -> Record:
    """The record with each torque beside the motion of its time.

    No drive moves before the torque that moves it, so such a torque was logged late. It is shifted
    by whole samples; what remains is less than a sample. A torque that comes early may be a delay
    in the drive and stays.
    """
    rows = late_by(record, plain)
    pieces = [s for s in record.segments() if s.stop - s.start >= rows + FEWEST]
    if rows < 1 or not pieces:
        return record
    moved = {
        role: np.concatenate([_piece(x, s, rows, role == "u") for s in pieces])
        for role, x in record.channels().items()
    }
    edges = np.cumsum([s.stop - s.start - rows for s in pieces])[:-1]
    return replace(record, **moved, gaps=tuple(int(edge) for edge in edges))


def late_by(record: Record, plain: Balance) -> int:
    """By how many samples u is late for certain; 0 for less than one."""
    delay = plain.parameters.get(DELAY)
    if delay is None or delay.ci95 is None or delay.ci95[1] >= 0 or -delay.value < record.dt:
        return 0
    return round(-delay.value / record.dt)


def _piece(x: np.ndarray, s: slice, rows: int, later: bool) -> np.ndarray:
    """A piece of a channel without its last rows, or without the first ones."""
    return x[s.start + rows : s.stop] if later else x[s.start : s.stop - rows]
