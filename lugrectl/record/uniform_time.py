"""From the rows of a log to uniform time: bad samples are left out, recorded stamps and missing
samples become one step ``dt``, with gaps marked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.errors import Refused
from ..core.option_names import option
from .columns.names import UNITS
from .log import Log
from .record import Record
from .samples import bad_samples, clock
from .samples.needed_torque import leave_out_untrue_torque, unwrap_torque
from .samples.rows import HELD, Stamped, between, count, how, on_grid, smallest_steps
from .signal_noise import lattice_step, repeats

_FILL_SHARE = 0.01  # of the samples: more missing ones of an optional channel are not filled
_EXACT = 0.01  # stamps this close to the grid (in dt) count as on it
_LONGER = "Record 20 s or more without loss."
_TO_JUDGE = 200, 1.0  # samples and s in one piece that the comparison of models needs


# ---- what can be used ---------------------------------------------------------------


def usable(log: Log) -> Stamped:
    """A copy of the usable rows of a log, which are kept with it; each finding is a sentence."""
    checksum = log.checksum()
    if checksum not in log.kept:
        log.kept.clear()
        log.kept[checksum] = _found(log)
    return log.kept[checksum].copy()


def _found(log: Log) -> Stamped:
    made = Stamped.of(log)
    for role in ("d", "theta_load"):
        if role in made.channels and not made.channels[role].any():
            del made.channels[role]
            made.say(f"{role} is 0 in every row: left out.")
    for role, other in (("w", "theta"), ("theta", "w"), ("d", "u")):
        if {role, other} <= set(made.channels):
            share, usual = (np.isfinite(made.channels[r]).mean() for r in (role, other))
            if share < 0.5 * usual:  # it holds next to no number
                del made.channels[role]
                made.say(f"{role} has a number in {100 * share:.2g} % of the rows: left out.")
    clock.put_in_time(made)
    bad_samples.say_missing(made)
    bad_samples.unwrap_positions(made)
    for role in made.motion_roles:
        bad_samples.leave_out_code(made, role)
        bad_samples.leave_out_outliers(made, role)
    bad_samples.unwrap_positions(made)  # an outlier hides them
    clock.use_true_times(made)
    bad_samples.leave_out_kept_speed(made)
    bad_samples.cut_at_jumps(made)
    made.steps = smallest_steps(made.channels)  # a bad sample would hide them
    unwrap_torque(made)  # its wraps would look like bad samples
    bad_samples.leave_out_code(made, "u")
    bad_samples.leave_out_outliers(made, "u")
    clock.keep_renewed(made)
    leave_out_untrue_torque(made)
    return made


# ---- a record -----------------------------------------------------------------------


def uniform(log: Stamped) -> Record:
    """Bring rows to uniform time: short losses filled, jitter resampled, longer losses gaps."""
    _enough(log, len(log.t))
    _fill(log)
    clock.leave_out_scraps(log)
    whole = " in one piece" if log.new.sum() > 1 else ""
    _enough(log, max(p.stop - p.start for p in log.parts()), whole)
    return _regular(log)


def _enough(log: Stamped, rows: int, whole: str = "") -> None:
    if rows < clock.FEWEST:
        raise Refused(
            f"{log.source} is too short: {count(rows, 'row')}{whole} with torque and motion; at "
            f"least {clock.FEWEST} are needed.",
            _LONGER,
        )


def _fill(log: Stamped) -> None:
    """Fill what is missing for a few samples; a longer loss in torque or motion leaves a gap, and
    a channel beside them that has one is left out."""
    some, long = np.zeros(len(log.t), bool), np.zeros(len(log.t), bool)
    for role in [role for role in log.channels if not np.isfinite(log.channels[role]).all()]:
        x, lost = log.channels[role], ~np.isfinite(log.channels[role])
        apart = lost & (repeats(lost) > clock.FILL)
        if role in log.required:
            some |= lost
            long |= apart
        elif lost.all() or (role != "temperature" and (apart.any() or lost.mean() >= _FILL_SHARE)):
            del log.channels[role]
            log.say(f"{role} has too many missing samples and is left out.")
            continue
        else:
            log.say(f"{role} is missing in {count(lost.sum(), 'sample')}: filled in ({how(role)}).")
        good, rows = np.flatnonzero(~lost), np.arange(len(x))
        if not len(good):
            continue
        before = (np.searchsorted(good, rows, side="right") - 1).clip(0)
        log.channels[role] = x[good[before]] if role in HELD else between(role, good, x[good], rows)
    log.dropped += int(some.sum())
    if long.any():
        log.new |= np.r_[False, long[:-1]] & ~long
        log.keep(~long)
        _enough(log, len(log.t))


def _regular(log: Stamped) -> Record:
    """Return the record on grids of one step, one for each part."""
    parts, steps = log.parts(), np.diff(log.t)
    dt = clock.typical_step(steps[~log.new[1:]])
    counts = [np.r_[0, np.cumsum(clock.multiples(steps[p.start : p.stop - 1], dt))] for p in parts]
    ticks = sum(int(n[-1]) for n in counts)
    dt = clock.nice(float(sum(log.t[p.stop - 1] - log.t[p.start] for p in parts)) / max(ticks, 1))
    filled = ticks - sum(len(n) - 1 for n in counts)
    if filled:
        log.say(
            f"{count(filled, 'sample')} missing between the stamps of t, filled in "
            "(u held, motion interpolated)."
        )
    pieces = [_piece(log, p, n, dt) for p, n in zip(parts, counts, strict=True)]
    times: list[np.ndarray] = []
    for p, (grid, *_) in zip(parts, pieces, strict=True):
        t = log.t[p.start] + grid * dt
        if times and t[0] <= times[-1][-1]:  # its clock starts again: it follows a second later
            t = t - t[0] + times[-1][-1] + max(1.0, 10 * dt)
        times.append(t)
    worst = max(off for *_, off in pieces)
    if worst > _EXACT:
        log.say(
            f"t jitters by up to {100 * worst:.3g} % of its step of {dt:.6g} s: resampled to an "
            "even step (u held, motion interpolated)."
        )
    changed = log.dropped or filled or worst > _EXACT
    resolution = {r: s if r in log.channels else s * dt for r, s in log.steps.items()}
    return Record(
        np.concatenate(times),
        **{role: np.concatenate([made[role] for _, made, _ in pieces]) for role in log.channels},
        dt=dt,
        motion=log.motion,
        source=log.source,
        file=None,
        log=None,
        dropped=log.dropped + filled,
        messages=tuple(log.said),
        gaps=tuple(int(g) for g in np.cumsum([len(t) for t in times])[:-1]),
        resolution=resolution if changed else {},
    )


def _piece(
    log: Stamped, part: slice, ticks: np.ndarray, dt: float
) -> tuple[np.ndarray, dict[str, np.ndarray], float]:
    """The grid of a part in steps, its channels there, and how far its stamps are off the ticks."""
    at = (log.t[part] - log.t[part.start]) / dt
    worst = float(np.abs(at - ticks).max())
    off = worst > _EXACT
    at = at if off else ticks
    grid = np.arange(int(at[-1] + _EXACT) + 1)
    made = {role: x[part] for role, x in log.channels.items()}
    if off or len(grid) > len(at):
        before = np.searchsorted(at, grid, side="right") - 1
        for role, x in made.items():
            held = role in HELD and not off
            made[role] = x[before] if held else on_grid(role, at, x, grid, 1.0)
    return grid, made, worst


# ---- stretches: stamps interpolated, no more ----------------------------------------


def stretches(logs: Sequence[Log]) -> tuple[list[Stretch], list[str]]:
    """The stretches of uniform time in the logs of one drive, and what was noticed, as sentences;
    one ends where rows are lost, where time starts again and where the position jumps."""
    found, said = [], []
    for run, log in enumerate(logs):
        rows = usable(log)
        said += [f"{log.source}: {s}" if len(logs) > 1 else s for s in rows.said]
        for part in rows.parts():
            made = _stretch(run, rows, part)
            if made is not None and made.ok.sum() >= clock.FEWEST:
                found.append(made)
    return found, said


def _stretch(run: int, rows: Stamped, part: slice) -> Stretch | None:
    """One part on its own even grid; None without two samples of each channel. An instant is ``ok``
    between good samples of which at most one is missing."""
    t = rows.t[part]
    used = [*rows.required, *(["d"] if "d" in rows.channels else [])]
    values = {role: rows.channels[role][part] for role in used}
    if len(t) < clock.FEWEST or any(np.isfinite(x).sum() < clock.FEWEST for x in values.values()):
        return None
    dt = clock.typical_step(np.diff(t))
    steps = max(round((t[-1] - t[0]) / dt), 1)
    grid, dt = np.linspace(t[0], t[-1], steps + 1), float(t[-1] - t[0]) / steps
    made, ok = {}, np.ones(len(grid), bool)
    # of the clock: rows that a logger writes in bursts come at long and at short steps
    ticks = np.r_[0, np.cumsum(clock.multiples(np.diff(t), dt))]
    for role, x in values.items():
        good = np.isfinite(x)
        at, tick = t[good], ticks[good]
        made[role] = on_grid(role, at, x[good], grid, dt)
        after = np.searchsorted(at, grid - 1e-6 * dt)
        ok &= (after < len(at)) & (grid > at[0] - 1e-6 * dt)
        after = after.clip(0, len(at) - 1)
        before = (after - (at[after] > grid + 1e-6 * dt)).clip(0)
        ok &= tick[after] - tick[before] <= 2
    sound = np.flatnonzero(ok)
    if not len(sound):
        return None
    cut = slice(int(sound[0]), int(sound[-1]) + 1)
    channels = {role: x[cut] for role, x in made.items()}
    raw = values.get("theta")  # between the stamps theta is on no count any more
    step = 0.0 if raw is None else lattice_step(raw[np.isfinite(raw)])
    return Stretch(run=run, dt=dt, t=grid[cut], ok=ok[cut], count=step, **channels)


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch:
    """Uniform time, nothing filtered: at most the stamps are interpolated."""

    run: int  # index of the log that it comes from
    dt: float  # s
    t: np.ndarray  # (M,) s
    u: np.ndarray  # N m or N
    theta: np.ndarray | None = None  # rad or m
    w: np.ndarray | None = None  # rad/s or m/s
    ok: np.ndarray  # False where a sample is missing, bad or bridged over more than a sample
    d: np.ndarray | None = None  # measured load torque
    count: float = 0.0  # step of the encoder, rad; 0 where there is none to see


# ---- runs made alike ----------------------------------------------------------------


def pooled(records: Sequence[Record]) -> tuple[Record, ...]:
    """The runs with common channels: what a run lacks that has another is left out, and said."""
    for role, other in (("w", "theta"), ("theta", "w")):
        without = [r for r in records if getattr(r, role) is None]
        if 0 < len(without) < len(records) and all(getattr(r, other) is not None for r in records):
            first = next(i for i, r in enumerate(records) if getattr(r, role) is not None)
            none: dict[str, Any] = {role: None, "log": None}
            made = [replace(r, **none).read_from(r.log) for r in records]
            said = f"{without[0].source} has no {role}: it is left out in all runs."
            made[first] = made[first].with_messages(said)
            return tuple(made)
    return tuple(records)


# ---- what time says of a log --------------------------------------------------------


def long_enough_to_judge(record: Record) -> None:
    """Refused for a record too short or too slow to compare models by simulation."""
    parts = record.segments()
    most = max(p.stop - p.start for p in parts)
    samples, seconds = _TO_JUDGE
    if not clock.plausible(record.dt):
        labels = record.log.labels if record.log is not None else {}
        why = clock.slow(record.rate, labels, ", at which models of friction cannot be compared")
        raise Refused(f"{record.source}: {why}", "Record at 100 Hz or more.")
    if most < samples or most * record.dt < seconds - record.dt / 2:
        whole = "" if len(parts) == 1 else " in its longest piece"
        raise Refused(
            f"{record.source} is too short to judge models by simulation: {most * record.dt:.4g} s "
            f"and {most} samples{whole}; at least {seconds:g} s and {samples} samples are needed.",
            _LONGER,
        )


def refuse_open_time(source: str, labels: Mapping[str, str | None], dt: float) -> None:
    """Refused where t has no unit and no drive writes a log in steps of ``dt`` s."""
    if labels.get("t", "s") is not None or clock.plausible(dt):
        return
    times = [u for u in UNITS.values() if u.quantity == "time" and u.factor < 1.0]
    unit = next((u.name for u in times if clock.plausible(dt * u.factor)), "ms")
    raise Refused(
        f"{source}: t has no unit, and read as s it gives a sampling rate of "
        f"{1.0 / dt:.6g} Hz, at which no drive writes a log: give "
        f"{option('units', f't={unit}')}, or {option('units', 't=s')} if that is right.",
        f"Write the unit of t into the header, as in t [{unit}].",
    )
