"""The angle behind a speed that is counts over the time since the last encoder edge: such a speed
keeps its value while no edge comes; times that time it is a whole number of counts.
"""

from __future__ import annotations

import numpy as np

from ..record.signal_noise import quantum

WHOLE = 0.03  # of a count, by which a whole number may be missed
MOSTLY = 0.95  # of the edges that must be whole numbers
FEWEST, SLOW = 20, 3  # edges, and those more than a row apart
SPAN, EVEN = 64, 0.4  # rows, and counts RMS off a smooth angle in them (evenly rounded: 0.29)
OFTEN = 0.01  # of the rows, that a speed of whole counts per row takes


def angle_of(t: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, float] | None:
    """The angle at every row and its count; None where the speed is of another kind."""
    at = np.flatnonzero(np.diff(w, prepend=0.0) != 0)
    if len(at) < FEWEST:
        return None
    dt = float(np.median(np.diff(t)))
    since = np.diff(np.round((t[at] - t[0]) / dt), prepend=0.0)  # rows
    passed = np.abs(w[at]) * since * dt
    late = passed[(since > 1) & (passed > 0)]
    tried = [float(np.quantile(late, 0.02))] if len(late) > FEWEST else []
    values, many = np.unique(np.round(np.abs(w), 6), return_counts=True)
    often = values[(many > OFTEN * len(w)) & (values > 0)]  # their least difference: one per row
    usual = float(np.diff(often, prepend=0.0).min()) * dt if len(often) else 0.0
    for count in (*tried, quantum(np.abs(w)) * dt, *(usual * n for n in range(1, 5))):
        x = _angle(w, at, since, dt, count) if count else None
        if x is not None:
            return x, count
    return None


def _angle(
    w: np.ndarray, at: np.ndarray, since: np.ndarray, dt: float, count: float
) -> np.ndarray | None:
    """The angle, with this count; None where what passes is no whole number of it. Between two
    changes of w lie edges at the old speed, equally far apart, and one at the new."""
    rate = np.abs(w[at]) * dt / count  # counts per row
    own = _rows_of(rate, since)
    repeats = np.append(0.0, own[:-1])
    rest = since - own
    with np.errstate(all="ignore"):
        going = (rest > 0) & (repeats > 0) & (np.mod(rest, repeats) == 0)
    own = np.where(going, own, since)
    if np.mean(_is_whole(rate * own)) < MOSTLY:
        return None
    slow = (own > 1) & (rate > 0)  # one count after many rows: a mere register would not do that
    if np.sum(slow) < SLOW:
        # counts of an encoder add up to a smooth angle, the rounded values of a register drift
        x = np.cumsum(w) * dt / count
        parts = x[: len(x) // SPAN * SPAN].reshape(-1, SPAN)
        Q = np.linalg.qr(np.vander(np.arange(SPAN) / SPAN, 3))[0]
        left = np.sqrt(np.mean((parts - parts @ Q @ Q.T) ** 2, axis=1))
        moved = np.ptp(np.diff(parts, axis=1), axis=1) > 0.5
        if moved.sum() <= FEWEST or np.median(left[moved]) >= EVEN:
            return None
    elif np.median(rate[slow] * own[slow]) > 1.5:
        return None
    steps = np.zeros(len(w))
    steps[at] = w[at] * own * dt
    for i in np.flatnonzero(going):
        edges = np.arange(at[i - 1] + repeats[i], at[i] - own[i] + 1, repeats[i]).astype(int)
        steps[edges] = w[at[i - 1]] * repeats[i] * dt
    return np.cumsum(steps)


def _rows_of(rate: np.ndarray, since: np.ndarray) -> np.ndarray:
    """The rows from one edge to the next at a rate: one from a count per row on."""
    with np.errstate(all="ignore"):
        rows = np.where(rate > 0, np.round(1 / rate), 0.0)
        slow = (rows > 1) & (np.abs(rows * rate - 1) < WHOLE / 10)
    fast = (rate > 0.5) & _is_whole(rate)
    return np.minimum(np.where(fast, 1.0, np.where(slow, rows, since)), since)


def _is_whole(x: np.ndarray) -> np.ndarray:
    return np.abs(x - np.round(x)) < WHOLE
