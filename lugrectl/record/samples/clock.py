"""Stamps as data: rows without a true time, timers that wrap, jitter, time that starts again, and
channels that are renewed only every k-th row."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import ndimage

from ...core.option_names import option
from .rows import HELD, Stamped, bridged, count, means_from

HUGE = 1e15  # in SI units: numbers no finer than 0.1, which stand for a missing value
FEWEST = 12  # rows in one piece; fewer show no motion
FILL = 3  # most rows missing in a row that do not make a gap
_JITTER = 0.2  # steps that vary by more hide missing rows
_BESIDE = 25  # rows on either side of a gap that show whether time was lost
_WILD = 200  # most rows in a row whose stamps are wrong while the rows around them go on
_RATES = (5.0, 5e5)  # Hz; outside, the unit of time may be wrong
_TICKS = (1.0, 1e-3, 1e-6, 1e-7, 1e-9)  # s, of timers that count up to a power of two
_DAY = 86400.0  # s
_WIDTH = 51  # rows over which the true clock is even
_SMOOTHER = 1.5  # times, to believe the count of rows more than the stamps


def put_in_time(log: Stamped) -> None:
    """Leave out rows without a true stamp, unwrap timers, and cut where time starts again."""
    with np.errstate(invalid="ignore"):
        none = ~np.isfinite(log.t) | (np.abs(log.t) >= HUGE)
    if none.any():
        log.say(f"t is missing in {count(int(none.sum()), 'row')}: left out.")
        log.keep(~none)
    steps = np.diff(log.t)
    if 2 * np.count_nonzero(steps < 0) > len(steps):
        log.say("t falls from row to row: the rows were read from the last to the first.")
        log.t, log.rows = log.t[::-1], log.rows[::-1]
        log.new = np.r_[True, log.new[:0:-1]]
        log.channels = {role: values[::-1] for role, values in log.channels.items()}
    columns = (log.t, *(log.channels[role] for role in log.required))
    empty = np.all([x == 0 for x in columns], axis=0)  # a buffer that was not filled
    if len(empty):
        empty[0] &= len(empty) > 1 and bool(empty[1])  # a log may begin at rest
    if empty.any() and not empty.all():
        log.say(f"All columns are 0 {log.places(empty)}: left out.")
        log.keep(~empty)
    _wild(log)
    _back(log)
    use_true_times(log)
    _merge_doubles(log)
    _gaps(log)
    steps = np.diff(log.t)[~log.new[1:]]
    if len(steps) and steps.max() > 0 and not plausible(typical_step(steps)):
        log.say(slow(1 / typical_step(steps), log.labels))


def slow(rate: float, labels: Mapping[str, str | None], why: str = "") -> str:
    """A sentence on a rate, Hz, that shows no friction; ``labels`` without t: the user gave it."""
    if labels and "t" not in labels:
        given = option("rate", f"{1e3 / rate:.6g}")
        step = f"; if {rate:.6g} is the step in ms, give {given}" if rate < _RATES[0] else ""
        return f"{option('rate')} gives {rate:.6g} samples per second{why}{step}."
    unit = (
        "if t is not in the stated or assumed unit, give its unit, e.g. "
        f"{option('units', 't=ms')} (or s, us)."
    )
    return f"t gives a sampling rate of {rate:.6g} Hz{why}{';' if why else ':'} {unit}"


def usual_step(t: np.ndarray) -> float:
    """The median of the steps forward, in s; 0 without any."""
    steps = np.diff(t)
    ahead = steps[steps > 0]
    return float(np.median(ahead)) if len(ahead) else 0.0


def _wild(log: Stamped) -> None:
    """Leave out rows with stamps off the line of those around them."""
    dt, wild = usual_step(log.t), np.zeros(len(log.t), bool)
    for k in np.flatnonzero(np.diff(log.t) < 0):
        wild[_off_line(log.t, int(k), dt)] = True
    if not wild.any():
        return
    around, t = "go on from the rows around it", f"{log.t[int(wild.argmax())]:.9g} s"
    said = f"t does not {around} {log.places(wild)} ({t}): left out."
    if wild.sum() == 1:
        said = f"t at {log.place(int(wild.argmax()))} is {t}, which does not {around}: left out."
    log.say(said)
    log.keep(~wild)


def _off_line(t: np.ndarray, k: int, dt: float) -> slice:
    """The rows about a step back from k to k + 1 without which time goes on; none for good."""
    for m in range(1, _WILD + 1):
        for a, b in ((k, k + m + 1), (k - m, k + 1)):
            if a >= 0 and b < len(t) and 0.3 * dt * m < t[b] - t[a] < 3 * dt * (m + 1):
                return slice(a + 1, b)
        if k == 0 and m == 1:  # the first row, before which there is nothing to go on from
            return slice(0, 1)
    return slice(0, 0)


def _back(log: Stamped) -> None:
    """Where time goes back for good, a timer wrapped or another run begins."""
    t, dt, wraps = log.t, usual_step(log.t), []
    for k in map(int, np.flatnonzero(np.diff(t) < 0)):
        jump = float(t[k] + dt - t[k + 1])
        # a timer counts up to a power of two of its ticks
        timers = (tick * 2.0 ** max(np.rint(np.log2(max(jump / tick, 1.0))), 8) for tick in _TICKS)
        near = (p for p in (_DAY, *timers) if p > 20 * dt and abs(p - jump) <= 2 * dt)
        period = float(next(near, 0.0))
        if period:
            log.t = log.t + period * (np.arange(len(t)) > k)
            wraps.append(f"{period:.10g} s at {log.place(k + 1)}")
            continue
        log.new[k + 1] = True
        log.say(
            f"Time starts again at {log.place(k + 1)} (from {t[k]:.9g} s to "
            f"{t[k + 1]:.9g} s): the parts are treated separately."
        )
    if wraps:
        more = f" and {len(wraps) - 1} times more" if len(wraps) > 1 else ""
        log.say(f"t wraps by {wraps[0]}{more}: unwrapped.")


# ---- the step -----------------------------------------------------------------------


def multiples(steps: np.ndarray, dt: float) -> np.ndarray:
    """How many steps of the clock each step of the stamps is; 1 where they only jitter."""
    whole = np.maximum(np.rint(steps / dt), 1).astype(int)
    jitters = len(steps) > 0 and _unevenness(steps, dt) > _JITTER
    return np.ones(len(steps), int) if jitters else whole


def typical_step(steps: np.ndarray) -> float:
    """The step of the clock in s: the median, or the mean where steps vary a lot."""
    dt = float(np.median(steps))
    return dt if dt > 0 and _unevenness(steps, dt) < _JITTER else float(np.mean(steps))


def _unevenness(steps: np.ndarray, dt: float) -> float:
    """How far the steps of the stamps are off whole steps ``dt`` of the clock, but for the rarest,
    as a share of ``dt``."""
    ticks = steps / dt
    return float(np.quantile(np.abs(ticks - np.maximum(np.rint(ticks), 1)), 0.99))


def plausible(dt: float) -> bool:
    """Whether this is the step in s of a servo log."""
    return _RATES[0] <= 1 / dt < _RATES[1]


def nice(dt: float) -> float:
    """Remove the last digits, which are rounding of the stamps."""
    short = float(f"{dt:.6g}")
    return short if abs(short - dt) < 1e-9 * dt else float(f"{dt:.12g}")


def _merge_doubles(log: Stamped) -> None:
    """Merge rows of one stamp: the last value of a held channel, the mean of the others."""
    first = np.r_[True, np.diff(log.t) > 0] | log.new
    if first.all():
        return
    starts = np.flatnonzero(first)
    last = np.append(starts[1:], len(first)) - 1
    channels = {
        role: values[last] if role in HELD else means_from(starts, values)
        for role, values in log.channels.items()
    }
    merged = len(first) - len(starts)
    log.keep(first)
    log.channels = channels
    log.dropped += merged
    log.say(f"t is repeated in {count(merged, 'row')}: merged into one per time stamp.")


def _gaps(log: Stamped) -> None:
    """Begin a new part after a longer loss of rows, say it, and leave out parts of a few rows."""
    for part in (p for p in log.parts() if p.stop - p.start > 1):
        t, dt = log.t[part], typical_step(np.diff(log.t[part]))
        for k in np.flatnonzero(np.diff(t) > (FILL + 1.5) * dt):
            # stamps that are only late are made up for soon
            before, after = t[max(k - _BESIDE + 1, 0) : k + 1], t[k + 1 : k + 1 + _BESIDE]
            start = np.median(before - dt * np.arange(1 - len(before), 1))
            end = np.median(after - dt * np.arange(1, len(after) + 1))
            log.new[part.start + k + 1] |= end - start > (FILL + 0.5) * dt
    leave_out_scraps(log)
    parts, dt = log.parts(), usual_step(log.t)
    ends = [(log.t[a.stop - 1], log.t[b.start]) for a, b in zip(parts, parts[1:], strict=False)]
    gaps = [(a, b) for a, b in ends if b - a > 1.5 * dt]
    if gaps:
        lost = round(sum(float(b - a) - dt for a, b in gaps) / dt)
        log.say(
            f"About {lost} samples are lost in {count(len(gaps), 'gap')}, the first at "
            f"t = {gaps[0][0]:.6g} s; the parts are treated separately."
        )


def leave_out_scraps(log: Stamped) -> None:
    """Leave out parts that are too short to be useful, if there are others."""
    scraps = np.zeros(len(log.t), bool)
    for part in log.parts():
        scraps[part] = part.stop - part.start < FEWEST
    if scraps.any() and not scraps.all():
        log.dropped += int(scraps.sum())
        log.say(
            f"{count(int(scraps.sum()), 'sample')} in stretches shorter than {FEWEST} samples "
            "between gaps were left out."
        )
        log.keep(~scraps)


def use_true_times(log: Stamped) -> None:
    """Replace stamps by a smooth clock where that makes the motion much smoother."""
    x, t = log.motion_signal, log.t.copy()
    for part in log.parts():
        good = np.isfinite(x[part])
        if part.stop - part.start > 2 * _WIDTH and good.mean() > 0.5:
            t[part] = _believed(log.t[part], bridged(x[part], ~good))
    if not np.array_equal(t, log.t):
        rms = float(np.std(t - log.t))
        log.say(
            f"The motion is much smoother over an even clock than over the stamps of t: they were "
            f"given late or rounded ({rms:.2g} s RMS), and the even clock was used."
        )
        log.t = t


def _believed(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    steps = np.diff(t)
    if np.std(steps) < 0.02 * np.mean(steps) or steps.max() > 20 * np.mean(steps):
        return t
    rows = np.arange(len(t))
    line = np.polyval(np.polyfit(rows, t, 1), rows)
    late = ndimage.median_filter(t - line, _WIDTH, mode="nearest")
    even = line + ndimage.uniform_filter1d(late, _WIDTH, mode="nearest")
    if np.any(np.diff(even) <= 0) or np.abs(np.diff(late)).max() > 3 * np.mean(steps):
        return t  # rows are missing
    first = np.r_[True, steps > 0]  # stamps rounded to few digits come again
    return even if _roughness(t[first], x[first]) > _SMOOTHER * _roughness(even, x) else t


def off_cubic_in_time(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Distance of samples x (N,) from the cubic in time through two on either side, or nan."""
    off, beside = np.full(len(x), np.nan), (0, 1, 3, 4)
    since = [t[k : len(t) - 4 + k] - t[2:-2] for k in beside]
    value = np.zeros(len(x) - 4)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for i, k in enumerate(beside):
            share = np.ones(len(value))
            for other in (b for j, b in enumerate(since) if j != i):
                share *= other / (other - since[i])
            value += share * x[k : len(x) - 4 + k]
    off[2:-2] = np.abs(x[2:-2] - value)
    return off


def _roughness(t: np.ndarray, x: np.ndarray) -> float:
    """The usual distance of a sample from the cubic in time through its neighbours."""
    return float(np.nanmean(np.sqrt(off_cubic_in_time(t, x))) ** 2)


# ---- channels that are renewed only every k-th row ----------------------------------

_SLOWEST = 64  # rows; a channel held for longer is one that stands
_ON_BEAT = 0.97  # of its changes come every k-th row
_CHANGES = 20  # that show it


def _renewed_every(x: np.ndarray) -> tuple[int, int]:
    """Every how many rows a channel (N,) changes, and the place below that where; (1, 0) if it may
    change in any row. NaN counts as no change."""
    good = np.flatnonzero(np.isfinite(x))
    at = good[1:][np.diff(x[good]) != 0]
    # each change off the beat spoils two distances at most
    often = len(at) < _CHANGES or np.sum(np.diff(at) == 1) > 2 * (1 - _ON_BEAT) * len(at) + 1
    for every in () if often else range(_SLOWEST, 1, -1):
        shares = np.bincount(at % every, minlength=every) / len(at)
        if shares.max() >= _ON_BEAT and len(at) >= max(_CHANGES, 0.1 * len(x) / every):
            return every, int(shares.argmax())
    return 1, 0


def keep_renewed(log: Stamped) -> None:
    """Keep the rows that were sampled; leave out a second motion signal that is slower. A torque
    that is stepped between a few levels stays; one that is renewed more often is averaged."""
    found = {role: _renewed_every(log.channels[role]) for role in log.required}
    found = {role: (every, row) for role, (every, row) in found.items() if every > 1}
    if not found:
        return
    dt = typical_step(np.diff(log.t)[~log.new[1:]])
    slow = [role for role in ("theta", "w") if role in found]
    if {"theta", "w"} <= set(log.channels) and len(slow) == 1:
        other, every = "theta" if slow[0] == "w" else "w", found.pop(slow[0])[0]
        log.say(
            f"{slow[0]} is renewed only every {1e3 * every * dt:.4g} ms: left out, as {other} is "
            "renewed in every row."
        )
        del log.channels[slow.pop()]
    if "u" in found and not slow:
        every, first = found["u"]
        values = log.channels["u"][first::every]
        values = values[np.isfinite(values)]
        if len(np.unique(values)) < 0.3 * len(values):  # the same again and again: a program
            del found["u"]
    if not found:
        return
    every, first = max(found.values())
    verb = "are" if len(found) > 1 else "is"
    log.say(
        f"{' and '.join(found)} {verb} renewed only every {1e3 * every * dt:.4g} ms: only these "
        "rows are used."
    )
    rows = np.arange(first, len(log.t), every)
    if "u" not in found:
        means = np.full(len(log.t), np.nan)
        means[rows] = means_from(rows, log.channels["u"])  # its integral is kept
        log.channels["u"] = means
    log.keep(np.isin(np.arange(len(log.t)), rows))
