"""Bad samples, found on the rows as recorded by what is beside them: marks of a missing value,
codes, outliers, jumps of a position that are no motion, and motion that stands still by mistake."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from ...core.unit_names import si_unit
from ..signal_noise import quantum, repeats, resolution, spread
from .clock import FILL, HUGE, off_cubic_in_time, usual_step
from .needed_torque import balance
from .rows import Stamped, bridged, count, how

_OFF = "far off its neighbours"
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
_BRIEF = 4  # rows that are off together; a code stands for one answer or a few
_CUBIC = np.array([1.0, -4.0, 0.0, -4.0, 1.0]) / 6  # through two samples on either side
_TURN = 2 * np.pi
_TURNS = 16  # most turns after which a counter wraps (57 turns would look like 360 deg)
_SMALL = 1 / 3  # of the range, largest step beside which a wrap (above two thirds) is plain
_BITS = (8, 10, 12, 14, 15, 16, 18, 20, 24, 31, 32)  # of counters
_STUCK, _LONG = 3, 20  # equal samples in a row that may be a stuck sensor; of a noisy speed


def say_missing(log: Stamped) -> None:
    """Say where the log itself holds no number, or one that no sensor gives."""
    for role in log.required:
        missing = ~np.isfinite(log.channels[role])
        short = missing & (repeats(missing) <= FILL)
        for rows, what in ((short, f"filled in ({how(role)})"), (missing & ~short, "cut there")):
            if rows.any():
                log.say(f"{role} has no number {log.places(rows)}: {what}.")
        with np.errstate(invalid="ignore"):
            huge = np.abs(log.channels[role]) >= HUGE
        _leave_out(log, role, huge, "which no sensor gives")


def _leave_out(log: Stamped, role: str, bad: np.ndarray, why: str = _OFF) -> None:
    """Make samples of a channel nan and say it in one sentence with place and value."""
    if not bad.any():
        return
    first = int(bad.argmax())
    value = log.value(role, first)
    sentence = f"{role} is {why} {log.places(bad)} ({value}): left out."
    if np.count_nonzero(bad) == 1:
        sentence = f"{role} at {log.place(first)} is {value}, {why}: left out."
    log.leave_out(role, bad, sentence)


# ---- codes --------------------------------------------------------------------------


def leave_out_code(log: Stamped, role: str) -> None:
    """Leave out a frequent value that stands for a few rows at a time, far off the others."""
    x = log.channels[role]
    bad = np.isfinite(x)
    bad[bad] = _code(x[bad])
    if bad.any():
        value = log.value(role, int(bad.argmax()))
        sentence = f"{role} is exactly {value} {log.places(bad)}, {_OFF}: left out."
        log.leave_out(role, bad, sentence)


def _code(x: np.ndarray) -> np.ndarray:
    """Return where a channel (N,), all finite, holds one frequent value for a few rows, far off."""
    values, counts = np.unique(x, return_counts=True)
    often = values[np.argsort(-counts)[:2]] if len(values) >= 20 else []
    for value in dict.fromkeys((0.0, *often, values[0], values[-1])) if len(often) else ():
        at = x == value
        found = at & (repeats(at) <= _BRIEF)
        if at.sum() > _MOST * len(x) or found.sum() < max(_FEWEST, 0.8 * at.sum()):
            continue
        plain, others = bridged(x, found), np.flatnonzero(~found)
        after = np.searchsorted(others, np.flatnonzero(found))
        beside = (x[others[k.clip(0, len(others) - 1)]] for k in (after - 1, after))
        steps = ndimage.median_filter(np.abs(np.diff(plain, append=plain[-1])), 9)
        rough = 8 * ndimage.maximum_filter1d(steps, 9) + 6 * resolution(plain)
        far = _outside(value, *beside) > rough[found] + 0.02 * spread(plain)
        if far.mean() > 0.5:
            return found
    return np.zeros(len(x), bool)


# ---- outliers -----------------------------------------------------------------------


def leave_out_outliers(log: Stamped, role: str) -> None:
    """Leave out samples of a channel that are far off their neighbours, by more than others; in the
    motion up to four in a row. What another signal shows stays, however rare it is."""
    good = np.isfinite(log.channels[role])
    x = bridged(log.channels[role], ~good)
    if good.sum() < 16 or np.ptp(x) == 0:
        return
    far = _distances(log.t, x)
    low, high = np.quantile(x, [0.01, 0.99])
    limit = _limits(x) + 3 * np.quantile(far, _RARE) + _SHARE.get(role, 0.0) * (high - low)
    bad = good & (far > limit)
    # the first and the last have neighbours on one side only: a pulse or a wrap may end there
    ends = [0, -1]
    bad[ends] &= _outside(x[ends], x[1:-1].min(), x[1:-1].max()) > 0.0
    if role == "u":
        bad[ends] &= far[ends] > high - low
        bad &= ~_felt(log, bad) if bad.any() else bad
    else:
        bad = good & (bad | _brief(x, limit)) & ~confirmed(log, role)
    if role == "w":  # it may be the difference of a position over lost rows: too large
        bad &= np.diff(log.t, prepend=log.t[:1]) <= 1.5 * usual_step(log.t)
    _leave_out(log, role, bad)


def _brief(x: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Return where two to four samples in a row lie beyond those on either side, all one way."""
    bad = np.zeros(len(x), bool)
    for rows in (2, 3, 4):
        before, after = x[: -rows - 1], x[rows + 1 :]
        least = most = x[1:-rows]
        for k in range(1, rows):  # far quicker than a reduction over so few samples
            own = x[1 + k : len(x) - rows + k]
            least, most = np.minimum(least, own), np.maximum(most, own)
        above = least - np.maximum(before, after)
        below = np.minimum(before, after) - most
        found = np.flatnonzero(np.maximum(above, below) > limit[1 : len(above) + 1]) + 1
        bad[(found[:, None] + np.arange(rows)).ravel()] = True
    return bad


def _felt(log: Stamped, bad: np.ndarray) -> np.ndarray:
    """Return where the motion shows the torque of these rows: a short one that did act. Of a
    reversal that shows the inertia, the speed changes in its direction as it hardly ever does."""
    fit, felt = balance(log, bad), np.zeros(len(bad), bool)
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


def _distances(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return how far each sample is from what its neighbours say, the nearest of five statements;
    beside a jump that stays, a sample goes on from the rows on one side."""
    beside = np.array([1, 1, 1, 0, 1, 1, 1], bool)
    low, high = (ndimage.rank_filter(x, k, footprint=beside, mode="mirror") for k in (2, 3))
    far, steps = np.fmin(_outside(x, low, high), _off_cubic(x)), np.diff(t)
    if np.ptp(steps) > _EVEN * np.abs(steps).max():  # else the stamps say the same as the rows
        far = np.fmin(far, off_cubic_in_time(t, x))
    far[2:] = np.fmin(far[2:], _outside(x[2:], x[1:-1], 2 * x[1:-1] - x[:-2]))
    far[:-2] = np.fmin(far[:-2], _outside(x[:-2], x[1:-1], 2 * x[1:-1] - x[2:]))
    for end, then, after, last in ((0, 1, 2, 3), (-1, -2, -3, -4)):
        near = _outside(x[end], x[then], 2 * x[then] - x[after])
        far[end] = min(near, _outside(x[end], x[after], 3 * x[after] - 2 * x[last]))
        far[then] = _outside(x[then], x[end], x[after])
    return far


def _outside(x: Any, one: Any, other: Any) -> np.ndarray:
    """Return the distance from the interval between two values; 0 inside."""
    return np.maximum(np.maximum(np.minimum(one, other) - x, x - np.maximum(one, other)), 0.0)


def _off_cubic(x: np.ndarray) -> np.ndarray:
    """Return the distance from the cubic through two samples on either side, with even steps."""
    return np.abs(x + ndimage.convolve1d(x, _CUBIC, mode="mirror"))


def _limits(x: np.ndarray) -> np.ndarray:
    """Return how far a sample may be from its neighbours, judged by those about it."""
    curve = _off_cubic(x)
    around = min(_AROUND, len(x) // 2 * 2 - 1)
    usual = ndimage.median_filter(curve, around, mode="mirror")
    usual = np.maximum(usual, 0.3 * np.median(curve[curve > 0]) if curve.any() else 0.0)
    steps = ndimage.median_filter(np.abs(np.diff(x, append=x[-1])), around, mode="mirror")
    return _FAR * usual + steps + 6 * resolution(x) + 1e-9 * spread(x)


# ---- jumps of the motion ------------------------------------------------------------


def _jumps(log: Stamped) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The steps of theta that neither its speed on either side nor w show: the good rows before
    and after each, and its size beyond the motion around."""
    x = log.channels["theta"]
    good = np.flatnonzero(np.isfinite(x))
    if len(good) < 16:
        return good[:0], good[:0], np.zeros(0)
    values, dt = x[good], usual_step(log.t) or 1.0
    elapsed = np.maximum(np.diff(log.t[good]) / dt, 1.0)
    speed, quiet = np.diff(values) / elapsed, resolution(values)
    far = _distances(np.arange(len(speed), dtype=float), speed)
    at = np.flatnonzero(far > _limits(speed) + 6 * quiet + 3 * np.quantile(far, _RARE))
    at = at[~confirmed(log, "theta")[good[at + 1]]]
    usual = bridged(speed, np.isin(np.arange(len(speed)), at))[at]
    return good[at], good[at + 1], np.diff(values)[at] - usual * elapsed[at]


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


def cut_at_jumps(log: Stamped) -> None:
    """Leave out runs of one position that end or begin at a jump and were not read; begin a part
    where the position jumps else."""
    if "theta" not in log.channels:
        return
    x, (a, b, size) = log.channels["theta"], _jumps(log)
    bad, edges = np.zeros(len(x), bool), np.r_[0, np.flatnonzero(np.diff(x) != 0) + 1, len(x)]
    for i, (before, after) in enumerate(zip(a, b, strict=True)):
        start = edges[np.searchsorted(edges, before, side="right") - 1]
        stop = edges[np.searchsorted(edges, after, side="right")]
        back = size[i + 1 : i + 2] * (a[i + 1 : i + 2] < stop)
        into, out_of = slice(start, before + 1), slice(after, stop)
        sudden = _is_stuck(log, into, x[max(start - 4, 0) : start + 1])
        bad[into] |= sudden
        returns = stop - after >= _STUCK and bool(np.any(size[i] * back < 0))
        bad[out_of] |= returns or _is_stuck(log, out_of, x[stop - 1 : stop + 4][::-1])
    if bad.any():
        _stands(log, "theta", bad)
        a, b, size = _jumps(log)
    new = [not log.new[i + 1 : j + 1].any() for i, j in zip(a, b, strict=True)]
    if any(new):
        b, size = b[new], size[new]
        log.new[b] = True
        more = f" and {count(len(b) - 1, 'time')} more" if len(b) > 1 else ""
        log.say(
            f"theta jumps by {size[0]:.4g} {si_unit('theta', log.motion)} at {log.place(b[0])}"
            f"{more}, which is no motion: the parts are treated separately."
        )


def _stands(log: Stamped, role: str, bad: np.ndarray) -> None:
    value = log.value(role, int(bad.argmax()))
    log.leave_out(
        role, bad, f"{role} stands at {value} {log.places(bad)}, and then jumps: left out."
    )


def leave_out_kept_speed(log: Stamped) -> None:
    """Leave out where a noisy speed keeps its last value now and then, and jumps after it."""
    x = log.channels.get("w", np.zeros(0))
    kept, steps = (x != 0) & (repeats(x) > _LONG), np.abs(np.diff(x))
    after, others = steps[kept[:-1] & ~kept[1:]], steps[~kept[:-1] & ~kept[1:]]
    if len(after) and np.mean(others == 0) < 0.3 and after.max() > 3 * np.nanquantile(others, 0.95):
        _stands(log, "w", kept)


def _is_stuck(log: Stamped, run: slice, beside: np.ndarray) -> bool:
    """Return whether the rows of one position, with the rows ``beside`` them, were not read."""
    if run.stop - run.start < _STUCK:
        return False
    steps = np.diff(beside[np.isfinite(beside)])
    if len(steps) > 1:  # the motion stops or sets in at once
        usual = abs(np.median(steps))
        if usual > 3 * np.abs(np.diff(steps)).max() + 1e-12 and abs(steps[-1]) > 0.5 * usual:
            return True
    return all(np.ptp(log.channels[role][run]) == 0 for role in log.required)


# ---- wrapped positions --------------------------------------------------------------


def unwrap_positions(log: Stamped) -> None:
    """Undo the wraps of positions, which lead from one end of their range to the other."""
    for role in ("theta", "theta_load"):
        if role not in log.channels:
            continue
        theta = log.channels[role]
        good = np.flatnonzero(np.isfinite(theta))
        steps, at = np.diff(theta[good]), good[:0]
        if len(good) >= 16:
            at = np.flatnonzero(np.abs(steps) > (1 - _SMALL) * np.ptp(theta[good]))
        period = _period(theta[good], steps, at, log.motion) if len(at) else 0.0
        if not period:
            continue
        turns = np.zeros(len(theta))
        turns[good[at + 1]] = -np.sign(steps[at])
        theta = theta + period * np.cumsum(turns)
        times = "once" if len(at) == 1 else f"{len(at)} times"
        said = f"{role} jumps by {period:.6g} {times}: unwrapped"
        if log.motion == "rotary" and abs(period - 360) < 1e-6:
            theta, label = np.pi / 180 * theta, log.labels.get(role)
            stated = f"stated in {label}" if label else "without a unit"
            said += f", and converted from deg ({stated}, but a turn is 360)"
        log.channels[role] = theta
        log.say(said + ".")


def _period(values: np.ndarray, steps: np.ndarray, at: np.ndarray, motion: str) -> float:
    """The period of a position that wraps in the steps ``at``: whole turns, a power of two of its
    own steps, or any at which the motion goes on; 0 where these are no wraps."""
    travel, step = float(np.ptp(values)), quantum(values)
    if np.abs(np.delete(steps, at)).max(initial=0.0) > _SMALL * travel:
        return 0.0
    speed = bridged(steps, np.isin(np.arange(len(steps)), at))[at]
    sizes, quiet = np.abs(steps[at] - speed), resolution(values)
    period, usual = float(np.median(sizes)), 2 * float(np.median(np.abs(speed))) + 4 * quiet
    alike = np.abs(sizes - period) <= 2 * np.abs(speed) + usual
    back = (np.diff(at) <= _BRIEF) & (np.diff(np.sign(steps[at])) != 0)
    if not alike.all() or (np.r_[False, back] | np.r_[back, False]).all():
        return 0.0
    known = [2.0**bits * step for bits in _BITS if step]
    known += [_TURN * n for n in range(1, _TURNS + 1)] + [360.0] if motion == "rotary" else []
    nearest = min(known, key=lambda size: abs(size - period), default=0.0)
    if abs(nearest - period) <= 2 * quiet + usual / np.sqrt(len(at)):
        return nearest
    moves = np.abs(speed) > max(0.5 * quiet, 1e-9 * travel)
    goes_on = not back.any() and moves.mean() > 0.6 and travel <= 1.02 * period + usual
    return period if goes_on and period >= 20 * usual else 0.0
