"""What the comparison cannot see in a record, in sentences."""

from __future__ import annotations

import numpy as np

from .base import Record
from .numbers import STILL

RESTS = 3  # from which the length of a rest could show something
LONG = 0.05  # s of a rest


def unseen(record: Record) -> tuple[str, ...]:
    """One sentence for each thing that the rows leave out."""
    m = record.motion
    slow = (np.abs(m.w) < STILL * m.top).astype(int)
    edges = np.flatnonzero(np.diff(np.r_[0, slow, 0]))
    rests = int(np.sum((edges[1::2] - edges[::2]) * m.dt > LONG))
    if rests < RESTS or "Fs" not in record.has:
        return ()
    return (
        f"The drive rests {rests} times. The comparison leaves rests out: it does not search for "
        "a stiction that grows with the length of a rest (dwell_stiction).",
    )
