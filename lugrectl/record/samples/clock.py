"""Stamps as data: rows without a true time, timers that wrap, jitter, time that starts again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import ndimage

from ...core.option_names import option
from .resampling import HELD
from .rows import Stamped, bridged, count, means_from

HUGE = 1e30  # in SI units; larger numbers stand for a missing value
FEWEST = 12  # rows in one piece; fewer show no motion
FILL = 3  # most rows missing in a row that do not make a gap
_EXACT = 0.01  # stamps this close to the grid (in steps) count as on it
_JITTER = 0.2  # steps that vary by more hide missing rows
_BESIDE = 25  # rows on either side of a gap that show whether time was lost
_WILD = 200  # most rows in a row whose stamps are wrong while the rows around them go on
_RATES = (5.0, 5e5)  # Hz; outside, the unit of time may be wrong
_TICKS = (1.0, 1e-3, 1e-6, 1e-7, 1e-9)  # s, of timers that count up to a power of two
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
    _even_out(log)
    _merge_doubles(log)
    _gaps(log)
    _jitter(log)
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
    first, around = int(wild.argmax()), "go on from the rows around it"
    t = f"{log.t[first]:.9g} s"
    if wild.sum() == 1:
        log.say(f"t at {log.place(first)} is {t}, which does not {around}: left out.")
    else:
        log.say(f"t does not {around} {log.places(wild)} ({t}): left out.")
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
    dt = usual_step(log.t)
    shift = np.zeros(len(log.t))
    wraps: list[tuple[int, float]] = []
    for k in map(int, np.flatnonzero(np.diff(log.t) < 0)):
        period = float(log.t[k] + dt - log.t[k + 1])
        # a timer counts up to a power of two of its ticks
        timers = (
            tick * 2.0 ** max(np.rint(np.log2(max(period / tick, 1.0))), 8) for tick in _TICKS
        )
        near = (p for p in timers if p > 20 * dt and abs(p - period) <= 2 * dt)
        period = float(next(near, period * _goes_on(log, k)))
        shift[k + 1 :] += period
        if period:
            wraps.append((k + 1, period))
            continue
        log.new[k + 1] = True
        log.say(
            f"Time starts again at {log.place(k + 1)} (from {log.t[k]:.9g} s to "
            f"{log.t[k + 1]:.9g} s): the parts are treated separately."
        )
    log.t = log.t + shift
    if wraps:
        row, period = wraps[0]
        log.say(
            f"t wraps by {period:.10g} s at {log.place(row)}"
            f"{f' and {len(wraps) - 1} times more' if len(wraps) > 1 else ''}: unwrapped."
        )


def _goes_on(log: Stamped, k: int) -> bool:
    """Whether the motion goes on from row k to the next as it does around them."""
    x = log.motion_signal if "theta" in log.channels else np.cumsum(log.motion_signal)
    before, after = np.diff(x[max(k - 10, 0) : k + 1]), np.diff(x[k + 1 : k + 12])
    if not len(before) or not len(after):
        return False
    own, sides = x[k + 1] - x[k], (np.median(before), np.median(after))
    usual = float(np.mean(sides))  # at rest nothing shows
    far = max(abs(own - usual), abs(sides[0] - sides[1]))
    return bool(np.isfinite(usual) and usual != 0 and far <= 0.3 * abs(usual))


# ---- the step -----------------------------------------------------------------------


def multiples(steps: np.ndarray, dt: float) -> np.ndarray:
    """How many steps of the clock each step of the stamps is; 1 where they only jitter."""
    whole = np.maximum(np.rint(steps / dt), 1).astype(int)
    off = np.abs(steps / dt - whole)
    jitters = len(steps) > 0 and np.quantile(off, 0.99) > _JITTER
    return np.ones(len(steps), int) if jitters else whole


def typical_step(steps: np.ndarray) -> float:
    """The step of the clock in s: the median, or the mean where steps vary a lot."""
    dt = float(np.median(steps))
    if dt > 0 and np.quantile(np.abs(steps / dt - np.maximum(np.rint(steps / dt), 1)), 0.99) < 0.2:
        return dt
    return float(np.mean(steps))


def plausible(dt: float) -> bool:
    """Whether this is the step in s of a servo log."""
    return _RATES[0] <= 1 / dt < _RATES[1]


def nice(dt: float) -> float:
    """Remove the last digits, which are rounding of the stamps."""
    short = float(f"{dt:.6g}")
    return short if abs(short - dt) < 1e-9 * dt else float(f"{dt:.12g}")


def _even_out(log: Stamped) -> None:
    """Stamps rounded to few digits: the even grid that they were rounded from. Rows that are lost
    one by one leave the same steps; then the motion is smoother over the stamps."""
    t, x = log.t.copy(), log.motion_signal
    for part in log.parts():
        since, rows = t[part] - t[part.start], np.arange(part.stop - part.start)
        if len(rows) <= FEWEST or not _rounded(since, rows):
            continue
        dt = nice(float(np.polyfit(rows, since, 1)[0]))
        even = t[part.start] + dt * rows
        ahead = np.all(np.diff(t[part]) > 0)
        if ahead and _SMOOTHER * _roughness(t[part], x[part]) < _roughness(even, x[part]):
            continue
        t[part] = even
        log.say(f"t is rounded coarsely relative to its step: {dt:.6g} s was used throughout.")
    log.t = t


def _rounded(since: np.ndarray, rows: np.ndarray) -> bool:
    """Whether the stamps are an even grid rounded to few digits, without jitter or loss."""
    steps = np.diff(since)
    typical, spread = float(np.mean(steps)), np.ptp(steps)
    has_loss = steps.min() > 0 and steps.max() > 4 * typical
    if typical <= 0.0 or spread < 2 * _EXACT * typical or has_loss:
        return False
    _, shares = np.unique(np.rint(steps / (_EXACT * typical)), return_counts=True)
    if len(shares) != 2 or shares.min() < 0.02 * len(steps):
        return False
    error = since - np.polyval(np.polyfit(rows, since, 1), rows)
    return bool(np.abs(error).max() < 0.7 * spread)


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
    for part in log.parts():
        t = log.t[part]
        if len(t) < 2:
            continue
        dt = typical_step(np.diff(t))
        for k in np.flatnonzero(np.diff(t) > (FILL + 1.5) * dt):
            if _missing(t, int(k), dt) > FILL + 0.5:
                log.new[part.start + k + 1] = True
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


def _missing(t: np.ndarray, k: int, dt: float) -> float:
    """The number of rows lost after row k: stamps that are only late are made up for soon."""
    before, after = t[max(k - _BESIDE + 1, 0) : k + 1], t[k + 1 : k + 1 + _BESIDE]
    start = np.median(before - dt * np.arange(1 - len(before), 1))
    end = np.median(after - dt * np.arange(1, len(after) + 1))
    return float(end - start) / dt


def _jitter(log: Stamped) -> None:
    """Say how much the stamps jitter."""
    worst, rms, step = 0.0, 0.0, 0.0
    for part in log.parts():
        steps = np.diff(log.t[part])
        if len(steps) < 2:
            continue
        dt = typical_step(steps)
        off = steps - dt * multiples(steps, dt)
        if np.abs(np.cumsum(off)).max() > _EXACT * dt and np.abs(off).max() > _EXACT * dt:
            worst, rms, step = max(worst, np.abs(off).max()), max(rms, np.std(off)), dt
    if worst:
        log.say(
            f"t jitters by up to {100 * worst / step:.3g} % of its step of {step:.6g} s "
            f"({rms:.2g} s RMS): resampled to an even step (u held, motion interpolated)."
        )


def use_true_times(log: Stamped) -> None:
    """Replace stamps by a smooth clock where that makes the motion much smoother."""
    x, t = log.motion_signal, log.t.copy()
    for part in log.parts():
        values = x[part]
        good = np.isfinite(values)
        if part.stop - part.start > 2 * _WIDTH and good.mean() > 0.5:
            t[part] = _believed(log.t[part], bridged(values, ~good))
    if not np.array_equal(t, log.t):
        rms = float(np.std(t - log.t))
        log.say(
            f"The motion is much smoother over an even clock than over the stamps of t: they were "
            f"given late ({rms:.2g} s RMS), and the even clock was used."
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
    return even if _roughness(t, x) > _SMOOTHER * _roughness(even, x) else t


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
