"""Bad samples, found on the rows as recorded: marks of a missing value, codes, outliers."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ..signal_noise import repeats, resolution, spread
from .clock import FILL, HUGE, off_cubic_in_time, usual_step
from .needed_torque import needed
from .resampling import how
from .rows import Stamped, bridged, count

NO_SENSOR = "which no sensor gives"
OFF = "far off its neighbours"
_AROUND = 61  # rows about a sample that show what is usual there
_FAR = 10.0  # times the usual distance from the curve through the neighbours
_EVEN = 1e-6  # of a step: stamps that differ by less are even
_RARE = 0.97  # share of the samples that shows how far from the curve the channel is anyway
_REVERSAL = 0.99  # of the rows change their speed less than a reversal does
# least distance of an outlier, as a share of the channel's range: a drive may ask for a short
# torque, and a computed speed may jump, but a position has inertia behind it
_SHARE = {"u": 0.06, "w": 0.03}
_FEWEST = 5  # rows that a code fills, off the curve through the others
_MOST = 0.3  # of all rows; a value that is held longer is one
_BRIEF = 4  # rows, a code stands for one answer or a few
_CUBIC = np.array([1.0, -4.0, 0.0, -4.0, 1.0]) / 6  # through two samples on either side


def leave_out(log: Stamped, role: str, bad: np.ndarray, why: str, many: str = "") -> None:
    """Make samples of a channel nan and say it in one sentence with place and value."""
    if not bad.any():
        return
    first = int(bad.argmax())
    value = log.value(role, first)
    if np.count_nonzero(bad) == 1:
        sentence = f"{role} at {log.place(first)} is {value}, {why}: left out."
    else:
        sentence = f"{role} is {many or why} {log.places(bad)} ({value}): left out."
    log.leave_out(role, bad, sentence)


def say_missing(log: Stamped) -> None:
    """Say where the log itself holds no number."""
    for role in log.required:
        missing = ~np.isfinite(log.channels[role])
        lengths = repeats(missing)
        short = int(np.count_nonzero(missing & (lengths <= FILL)))
        if short:
            log.say(f"{role} is missing in {count(short, 'sample')}: filled in ({how(role)}).")
        long = missing & (lengths > FILL)
        if long.any():
            first, total = int(long.argmax()), int(long.sum())
            rows = count(int(lengths[first]), "row")
            more = f", {total} in all" if total > lengths[first] else ""
            log.say(
                f"{role} has no number in {rows} from {log.place(first)} on{more}: the record is "
                "cut there."
            )


def leave_out_huge(log: Stamped) -> None:
    """Leave out numbers that no sensor gives, such as 1e30 or the largest float."""
    for role in log.required:
        with np.errstate(invalid="ignore"):
            huge = np.abs(log.channels[role]) >= HUGE
        leave_out(log, role, huge, NO_SENSOR, "a number that no sensor gives")


def leave_out_bad_samples(log: Stamped, *roles: str) -> None:
    """Leave out the codes and the single outliers in these channels."""
    for role in roles:
        good = np.isfinite(log.channels.get(role, np.empty(0)))
        if good.sum() < 16:
            continue
        bad = good.copy()
        bad[good] = code(log.channels[role][good])
        if bad.any():
            value = log.value(role, int(bad.argmax()))
            sentence = f"{role} is exactly {value} {log.places(bad)}, {OFF}: left out."
            log.leave_out(role, bad, sentence)
        x = log.channels[role]
        good = np.isfinite(x)
        bad = outliers(role, log.t, bridged(x, ~good)) & good
        bad &= ~over_loss(log, role) & ~confirmed(log, role)
        if role == "u" and bad.any():
            bad &= ~_felt(log, bad)
        leave_out(log, role, bad, OFF)


# ---- codes --------------------------------------------------------------------------


def code(x: np.ndarray) -> np.ndarray:
    """Return where a channel (N,), all finite, holds one frequent value for a few rows, far off."""
    values, counts = np.unique(x, return_counts=True)
    if len(values) < 20:
        return np.zeros(len(x), bool)
    often = values[np.argsort(-counts)[:2]]
    for value in dict.fromkeys((0.0, *often, values[0], values[-1])):
        at = x == value
        if _FEWEST <= at.sum() <= _MOST * len(x):
            found = at & (repeats(at) <= _BRIEF)
            if found.sum() >= max(_FEWEST, 0.8 * at.sum()) and _is_off(x, found, value):
                return found
    return np.zeros(len(x), bool)


def _is_off(x: np.ndarray, at: np.ndarray, value: float) -> bool:
    """Return whether the value is mostly far outside the rows on either side."""
    others = np.flatnonzero(~at)
    if len(others) < 16:
        return False
    steps = np.abs(np.diff(x[others], append=x[others[-1]]))
    rough = ndimage.maximum_filter1d(ndimage.median_filter(steps, 9, mode="nearest"), 9)
    after = np.searchsorted(others, np.flatnonzero(at))
    before, after = (after - 1).clip(0), after.clip(0, len(others) - 1)
    low, high = np.quantile(x[others], [0.01, 0.99])
    limit = 8 * rough[after] + 6 * resolution(x[others]) + 0.02 * (high - low)
    far = outside(value, x[others[before]], x[others[after]]) > limit
    return bool(far.sum() >= _FEWEST and far.mean() > 0.5)


# ---- single outliers ----------------------------------------------------------------


def outliers(role: str, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return where samples of a channel (N,), all finite, are far off their neighbours, over rows
    and over stamps ``t`` (s), by more than others; in the motion, up to four in a row."""
    if len(x) < 16 or np.ptp(x) == 0:
        return np.zeros(len(x), bool)
    far = distances(t, x)
    limit = limits(role, x) + 3 * np.quantile(far, _RARE)
    bad = far > limit
    if role != "u":
        return bad | _brief(x, limit)
    # a torque may be a pulse of a few rows; its first and last have neighbours on one side only
    low, high = np.quantile(x, [0.01, 0.99])
    ends = [0, len(x) - 1]
    bad[ends] &= far[ends] > high - low
    return bad


def _brief(x: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Return where two to four samples in a row lie beyond those on either side, all one way."""
    bad = np.zeros(len(x), bool)
    for rows in (2, 3, 4):
        before, after = x[: -rows - 1], x[rows + 1 :]
        least, most = x[1:-rows], x[1:-rows]
        for k in range(1, rows):  # far quicker than a reduction over so few samples
            own = x[1 + k : len(x) - rows + k]
            least, most = np.minimum(least, own), np.maximum(most, own)
        above = least - np.maximum(before, after)
        below = np.minimum(before, after) - most
        found = np.flatnonzero(np.maximum(above, below) > limit[1 : len(least) + 1]) + 1
        for row in found:
            bad[row : row + rows] = True
    return bad


def distances(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return how far each sample is from what its neighbours say, the nearest of five statements;
    beside a jump that stays, a sample goes on from the rows on one side."""
    beside = np.array([1, 1, 1, 0, 1, 1, 1], bool)
    low, high = (ndimage.rank_filter(x, k, footprint=beside, mode="mirror") for k in (2, 3))
    far, steps = np.fmin(outside(x, low, high), _off_cubic(x)), np.diff(t)
    if np.ptp(steps) > _EVEN * np.abs(steps).max():  # else the stamps say the same as the rows
        far = np.fmin(far, off_cubic_in_time(t, x))
    far[2:] = np.fmin(far[2:], outside(x[2:], x[1:-1], 2 * x[1:-1] - x[:-2]))
    far[:-2] = np.fmin(far[:-2], outside(x[:-2], x[1:-1], 2 * x[1:-1] - x[2:]))
    for end, then, after, last in ((0, 1, 2, 3), (-1, -2, -3, -4)):
        near = outside(x[end], x[then], 2 * x[then] - x[after])
        far[end] = min(near, outside(x[end], x[after], 3 * x[after] - 2 * x[last]))
        far[then] = outside(x[then], x[end], x[after])
    return far


def outside(x: np.ndarray | float, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the distance from the interval between two values; 0 inside."""
    return np.maximum(np.maximum(np.minimum(one, other) - x, x - np.maximum(one, other)), 0.0)


def _off_cubic(x: np.ndarray) -> np.ndarray:
    """Return the distance from the cubic through two samples on either side, with even steps."""
    return np.abs(x + ndimage.convolve1d(x, _CUBIC, mode="mirror"))


def limits(role: str, x: np.ndarray) -> np.ndarray:
    """Return how far a sample may be from its neighbours, judged by those about it."""
    curve = _off_cubic(x)
    around = min(_AROUND, len(x) // 2 * 2 - 1)
    usual = ndimage.median_filter(curve, around, mode="mirror")
    usual = np.maximum(usual, 0.3 * np.median(curve[curve > 0]) if curve.any() else 0.0)
    steps = ndimage.median_filter(np.abs(np.diff(x, append=x[-1])), around, mode="mirror")
    low, high = np.quantile(x, [0.01, 0.99])
    least = _SHARE.get(role, 0.0) * (high - low) + 6 * resolution(x) + 1e-9 * spread(x)
    return _FAR * usual + steps + least


# ---- what an outlier is not ---------------------------------------------------------


def _felt(log: Stamped, bad: np.ndarray) -> np.ndarray:
    """Return where the motion shows the torque of these rows: a short one that did act. Of a
    reversal that shows the inertia, the speed changes in its direction as it hardly ever does."""
    fit, felt = needed(log, bad), np.zeros(len(bad), bool)
    if fit is None:
        return felt
    u = np.nan_to_num(log.channels["u"])
    plain = bridged(u, bad)
    with_it, without = np.abs(fit.missing(u)), np.abs(fit.missing(plain))
    change, way = np.nan_to_num(fit.a), np.sign(u - plain)
    often = np.quantile(np.abs(change), _REVERSAL)
    for row in np.flatnonzero(bad):
        near = slice(max(row - fit.width, 0), row + fit.width + 1)
        covered = np.isfinite(with_it[near]).sum() > fit.width
        felt[row] = covered and np.nansum(with_it[near]) < 0.8 * np.nansum(without[near])
        felt[row] |= np.max(way[row] * change[max(row - 2, 0) : row + 3]) > often
    return felt


def confirmed(log: Stamped, role: str) -> np.ndarray:
    """Return where theta and w agree that the drive moves this fast, however rare that is."""
    agree = np.zeros(len(log.t), bool)
    if role not in ("theta", "w") or not {"theta", "w"} <= set(log.channels):
        return agree
    theta, w = log.channels["theta"], log.channels["w"]
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.diff(theta) / np.diff(log.t)
        if role == "w":
            before, after = (np.abs(x - slope) < 0.5 * np.abs(x) for x in (w[:-1], w[1:]))
        else:
            fastest = np.where(np.abs(w[1:]) > np.abs(w[:-1]), w[1:], w[:-1])
            along, size = slope * np.sign(fastest), np.abs(fastest)
            before = after = (along > 0.3 * size) & (along < 3 * size)
    agree[1:] |= after
    agree[:-1] |= before
    return agree


def over_loss(log: Stamped, role: str) -> np.ndarray:
    """Return where a speed may be the difference of a position over lost rows: too large."""
    if role != "w":
        return np.zeros(len(log.t), bool)
    return np.diff(log.t, prepend=log.t[:1]) > 1.5 * usual_step(log.t)
