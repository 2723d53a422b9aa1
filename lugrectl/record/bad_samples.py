"""Bad samples of a log: they are found first, on the rows as recorded, said and left out."""

from __future__ import annotations

import numpy as np

from .clock import FILL, usual_step
from .codes import code
from .outliers import bridged, huge, outliers
from .resampling import HELD
from .stamped import Stamped, count, runs

ONE = "{role} at {place} is {value}, {why}: left out."
MANY = "{role} is {why} in {rows}, first at {place} ({value}): left out."
NO_SENSOR = "which no sensor gives"
OFF = "far off its neighbours"


def leave_out(log: Stamped, role: str, bad: np.ndarray, why: str, many: str = "") -> None:
    """Make samples of a channel nan and say it in one sentence with place and value."""
    if not bad.any():
        return
    rows = np.flatnonzero(bad)
    words = {"role": role, "place": log.place(rows[0]), "value": log.value(role, rows[0])}
    if len(rows) == 1:
        log.say(ONE.format(**words, why=why))
    else:
        log.say(MANY.format(**words, why=many or why, rows=count(len(rows), "row")))
    values = log.channels[role].copy()
    values[bad] = np.nan
    log.channels[role] = values


def say_missing(log: Stamped) -> None:
    """Say where the log itself holds no number."""
    for role in log.required:
        missing = ~np.isfinite(log.channels[role])
        short = sum(n for _, n in runs(missing) if n <= FILL)
        how = "held" if role in HELD else "interpolated"
        if short:
            log.say(f"{role} is missing in {count(short, 'sample')}: filled in ({how}).")
        for start, length in [(a, n) for a, n in runs(missing) if n > FILL][:1]:
            total = int(missing.sum()) - short
            many = f", {total} in all" if total > length else ""
            log.say(
                f"{role} has no number in {count(length, 'row')} from {log.place(start)} on{many}: "
                "the record is cut there."
            )


def leave_out_huge(log: Stamped) -> None:
    """Leave out numbers that no sensor gives."""
    for role in log.required:
        leave_out(log, role, huge(log.channels[role]), NO_SENSOR, "a number that no sensor gives")


def leave_out_bad_samples(log: Stamped, *roles: str) -> None:
    """Leave out the codes and the single outliers in these channels."""
    for role in roles:
        good = np.isfinite(log.channels.get(role, np.empty(0)))
        if good.sum() >= 16:
            _codes(log, role, good)
            _outliers(log, role)


def _codes(log: Stamped, role: str, good: np.ndarray) -> None:
    rows = np.flatnonzero(good)
    found = rows[code(log.channels[role][rows])]
    if len(found):
        at = np.isin(np.arange(len(good)), found)
        log.say(
            f"{role} is exactly {log.value(role, found[0])} in {count(len(found), 'row')}, first "
            f"at {log.place(found[0])}, far off its neighbours: left out."
        )
        values = log.channels[role].copy()
        values[at] = np.nan
        log.channels[role] = values


def _outliers(log: Stamped, role: str) -> None:
    x = log.channels[role]
    good = np.isfinite(x)
    bad = outliers(role, log.t, bridged(x, ~good)) & good
    leave_out(log, role, bad & ~over_loss(log, role), OFF)


def over_loss(log: Stamped, role: str) -> np.ndarray:
    """Where a speed may be the difference of a position over lost rows, as many times too large."""
    if role != "w":
        return np.zeros(len(log.t), bool)
    return np.diff(log.t, prepend=log.t[0]) > 1.5 * usual_step(log.t)
