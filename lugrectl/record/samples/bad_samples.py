"""Bad samples of a log: they are found first, on the rows as recorded, said and left out."""

from __future__ import annotations

import numpy as np

from .clock import FILL, usual_step
from .missing_codes import code
from .needed_torque import needed
from .outliers import bridged, huge, outliers
from .resampling import HELD
from .rows import Stamped, count, runs

ONE = "{role} at {place} is {value}, {why}: left out."
MANY = "{role} is {why} in {rows}, first at {place} ({value}): left out."
NO_SENSOR = "which no sensor gives"
OFF = "far off its neighbours"
_RARE = 0.99  # of the rows change their speed less than a reversal does


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
    bad &= ~over_loss(log, role) & ~confirmed(log, role)
    if role == "u" and bad.any():
        bad &= ~_felt(log, bad)
    leave_out(log, role, bad, OFF)


def _felt(log: Stamped, bad: np.ndarray) -> np.ndarray:
    """Where the motion shows the torque of these rows: a short one that the drive did apply.

    A reversal may be all that a log shows of the inertia: then the speed changes there, in the
    direction of the torque, as it hardly ever does.
    """
    fit, felt = needed(log, bad), np.zeros(len(bad), bool)
    if fit is None:
        return felt
    u = np.nan_to_num(log.channels["u"])
    plain = bridged(u, bad)
    with_it, without = np.abs(fit.missing(u)), np.abs(fit.missing(plain))
    change, way = np.nan_to_num(fit.a), np.sign(u - plain)
    often = np.quantile(np.abs(change), _RARE)
    for row in np.flatnonzero(bad):
        near = slice(max(row - fit.width, 0), row + fit.width + 1)
        costs = np.nansum(with_it[near]), np.nansum(without[near])
        covered = np.isfinite(with_it[near]).sum() > fit.width
        felt[row] = covered and costs[0] < 0.8 * costs[1]
        felt[row] |= np.max(way[row] * change[max(row - 2, 0) : row + 3]) > often
    return felt


def confirmed(log: Stamped, role: str) -> np.ndarray:
    """Where theta and w agree that the drive moves this fast, however rare that is."""
    made = np.zeros(len(log.t), bool)
    if role not in ("theta", "w") or not {"theta", "w"} <= set(log.channels):
        return made
    theta, w = log.channels["theta"], log.channels["w"]
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.diff(theta) / np.diff(log.t)
        if role == "w":
            made[1:] |= np.abs(w[1:] - slope) < 0.5 * np.abs(w[1:])
            made[:-1] |= np.abs(w[:-1] - slope) < 0.5 * np.abs(w[:-1])
            return made
        fastest = np.where(np.abs(w[1:]) > np.abs(w[:-1]), w[1:], w[:-1])
        along, size = slope * np.sign(fastest), np.abs(fastest)
        alike = (along > 0.3 * size) & (along < 3 * size)
    made[1:] |= alike
    made[:-1] |= alike
    return made


def over_loss(log: Stamped, role: str) -> np.ndarray:
    """Where a speed may be the difference of a position over lost rows, as many times too large."""
    if role != "w":
        return np.zeros(len(log.t), bool)
    return np.diff(log.t, prepend=log.t[:1]) > 1.5 * usual_step(log.t)
