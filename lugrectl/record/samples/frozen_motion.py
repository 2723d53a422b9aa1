"""Motion that stands still in the log while the drive goes on, or before there is a signal."""

from __future__ import annotations

import numpy as np

from .rows import Stamped, count, runs

_FEWEST = 3  # equal samples in a row that may be a stuck sensor
_LONG = 20  # the same of a speed, whose noise never stops


def leave_out_stuck(log: Stamped, role: str, a: np.ndarray, b: np.ndarray) -> None:
    """Leave out runs of one value that end or begin at a jump, from row a to row b.

    A drive comes to rest gradually: a position that stops at once, a speed that loses its noise,
    or a channel that stands still together with all others, was not read.
    """
    x = log.channels[role]
    bad = np.zeros(len(x), bool)
    for before, after in zip(a, b, strict=True):
        for start, stop in (_same(x, int(before), -1), _same(x, int(after), 1)):
            if role == "w" and x[start] == 0:
                continue  # a drive at rest may start within a row
            if stop - start >= _FEWEST and (
                _at_once(x, start, stop, int(before))
                or _all_stand(log, start, stop)
                or role == "w"
                and _without_noise(x, start, stop)
            ):
                bad[start:stop] = True
    if bad.any():
        bad = bad | _kept(x) if role == "w" else bad
        _say(log, role, bad)
        x = x.copy()
        x[bad] = np.nan
        log.channels[role] = x


def _kept(x: np.ndarray) -> np.ndarray:
    """Where a speed that keeps its last value now and then stands, whether a jump ends that."""
    made = np.zeros(len(x), bool)
    for a, n in runs(np.r_[False, np.diff(x) == 0]):
        made[a - 1 : a + n] = n >= _LONG and x[a] != 0
    return made & _differ(x[~made])


def _without_noise(x: np.ndarray, start: int, stop: int) -> bool:
    """Whether a run is long where other samples all differ from the one before."""
    return stop - start >= _LONG and _differ(np.r_[x[:start], x[stop:]])


def _differ(x: np.ndarray) -> bool:
    """Whether nearly every sample differs from the one before."""
    return len(x) > 1 and bool(np.mean(np.diff(x) == 0) < 0.05)


def _same(x: np.ndarray, row: int, way: int) -> tuple[int, int]:
    """The run of equal values from a row on, forward or backward: start and stop."""
    part = x[row::way] if way > 0 else x[row::-1]
    other = np.flatnonzero(part != x[row])
    length = int(other[0]) if len(other) else len(part)
    return (row, row + length) if way > 0 else (row - length + 1, row + 1)


def _at_once(x: np.ndarray, start: int, stop: int, before: int) -> bool:
    """Whether the motion stops or sets in at once, at the end of the run without the jump."""
    backward = before >= start  # the jump comes after the run
    beside = x[max(start - 4, 0) : start + 1] if backward else x[stop - 1 : stop + 4]
    steps = np.diff(beside[np.isfinite(beside)])
    if len(steps) < 2:
        return False
    last = steps[-1] if backward else steps[0]
    usual = np.median(steps)
    changes = np.abs(np.diff(steps)).max()
    return bool(abs(usual) > 3 * changes + 1e-12 and abs(last) > 0.5 * abs(usual))


def _all_stand(log: Stamped, start: int, stop: int) -> bool:
    """Whether torque and motion keep one value each."""
    parts = (log.channels[role][start:stop] for role in log.required)
    return all(bool((part == part[0]).all()) for part in parts)


def _say(log: Stamped, role: str, bad: np.ndarray) -> None:
    rows = np.flatnonzero(bad)
    log.say(
        f"{role} stands at {log.value(role, rows[0])} for {count(len(rows), 'row')} from "
        f"{log.place(rows[0])} on and then jumps: these rows are left out."
    )
