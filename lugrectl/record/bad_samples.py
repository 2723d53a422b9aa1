"""Bad samples of a log: they are found first, on the rows as recorded, said and left out."""

from __future__ import annotations

import numpy as np

from .clock import usual_step
from .outliers import bridged, huge, outliers
from .stamped import Stamped, count

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


def leave_out_bad_samples(log: Stamped) -> None:
    """Find the samples of torque and motion that cannot be values of their channel."""
    for role in log.required:
        x = log.channels[role]
        leave_out(log, role, huge(x), NO_SENSOR, "a number that no sensor gives")
        _outliers(log, role)


def _outliers(log: Stamped, role: str) -> None:
    x = log.channels[role]
    good = np.isfinite(x)
    if not good.any():
        return
    bad = outliers(role, log.t, bridged(x, ~good)) & good
    if role == "w":  # the difference of a position over lost rows is as many times too large
        bad[1:] &= np.diff(log.t) < 1.5 * usual_step(log.t)
    leave_out(log, role, bad, OFF)
