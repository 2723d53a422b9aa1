"""Uniform time: recorded stamps and missing samples become one step ``dt``, with gaps marked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..core.errors import Refused
from ..core.option_names import option
from .columns.units import UNITS
from .record import Record
from .samples.clock import FEWEST, FILL, multiples, nice, plausible, slow, typical_step
from .samples.resampling import HELD, between, held_mean, speed
from .samples.rows import Stamped, count, runs

_FILL_SHARE = 0.01  # of the samples: more missing ones of an optional channel are not filled
_EXACT = 0.01  # stamps this close to the grid (in dt) count as on it
_SLOW = ", at which models of friction cannot be compared"
_TO_JUDGE = 200, 1.0  # samples and s in one piece that the comparison of models needs


def uniform(log: Stamped) -> Record:
    """Bring the rows of a log, in SI units, to uniform time.

    Up to 3 missing samples in a row are filled, repeated stamps are merged, and rows whose
    stamps jitter are resampled; a longer loss becomes a gap. A held channel keeps its time
    integral, motion is interpolated by cubic splines (a speed that is the difference of a
    position: via that position), temperature linearly.

    Raises Refused when no 12 rows in one piece are left.
    """
    _enough(log, len(log.t))
    _fill_missing(log)
    return _regular(log)


def _enough(log: Stamped, rows: int, whole: str = "") -> None:
    if rows < FEWEST:
        raise Refused(
            f"{log.source} is too short: {count(rows, 'row')}{whole} with torque and motion; at "
            f"least {FEWEST} are needed.",
            "Record 20 s or more without loss.",
        )


def _fill_missing(log: Stamped) -> None:
    """Fill what is missing for a few samples; a longer loss in torque or motion leaves a gap."""
    _optional(log)
    lost = {role: ~np.isfinite(log.channels[role]) for role in log.required}
    long = np.zeros(len(log.t), bool)
    for where in lost.values():
        for a, n in runs(where):
            long[a : a + n] |= n > FILL
    affected = np.zeros(len(log.t), bool)
    for role, where in lost.items():
        affected |= where
        if where.any() and not where.all():
            log.channels[role] = _filled(role, log.channels[role], where)
    log.dropped += int(affected.sum())
    if long.any():
        log.new |= np.r_[False, long[:-1]] & ~long
        log.keep(~long)
        _enough(log, len(log.t))


def _optional(log: Stamped) -> None:
    """Fill the channels beside torque and motion, or leave them out."""
    for role in [role for role in log.channels if role not in log.required]:
        lost = ~np.isfinite(log.channels[role])
        if lost.all() or (role != "temperature" and not _isolated(lost)):
            del log.channels[role]
            log.say(f"{role} has too many missing samples and is left out.")
        elif lost.any():
            log.channels[role] = _filled(role, log.channels[role], lost)
            how = "held" if role in HELD else "interpolated"
            log.say(f"{role} is missing in {count(lost.sum(), 'sample')}: filled in ({how}).")


def _isolated(lost: np.ndarray) -> bool:
    longest = max((length for _, length in runs(lost)), default=0)
    return longest <= FILL and lost.mean() < _FILL_SHARE


def _filled(role: str, values: np.ndarray, lost: np.ndarray) -> np.ndarray:
    good, rows = np.flatnonzero(~lost), np.arange(len(values))
    if role in HELD:
        before = np.searchsorted(good, rows, side="right") - 1
        return values[good[np.maximum(before, 0)]]
    return between(role, good, values[good], rows)


def _regular(log: Stamped) -> Record:
    parts = _long_parts(log, log.parts())
    _enough(log, max(p.stop - p.start for p in parts), " in one piece" if log.new.sum() > 1 else "")
    steps = np.diff(log.t)
    inside = np.concatenate([np.arange(p.start, p.stop - 1) for p in parts])
    dt = typical_step(steps[inside])
    counts = [np.r_[0, np.cumsum(multiples(steps[p.start : p.stop - 1], dt))] for p in parts]
    ticks = sum(int(n[-1]) for n in counts)
    dt = nice(float(sum(log.t[p.stop - 1] - log.t[p.start] for p in parts)) / max(ticks, 1))
    filled = ticks - sum(len(n) - 1 for n in counts)
    pieces = [_piece(log, p, n, dt) for p, n in zip(parts, counts, strict=True)]
    return _joined(log, pieces, dt, filled)


def _long_parts(log: Stamped, parts: list[slice]) -> list[slice]:
    """Leave out stretches between gaps that are too short to be useful."""
    kept = [p for p in parts if p.stop - p.start >= FEWEST]
    lost = len(log.t) - sum(p.stop - p.start for p in kept)
    if kept and lost:
        log.dropped += lost
        log.say(
            f"{count(lost, 'sample')} in stretches shorter than {FEWEST} samples "
            "between gaps were left out."
        )
    return kept or [max(parts, key=lambda p: p.stop - p.start)]


@dataclass(frozen=True)
class _Piece:
    t: np.ndarray
    channels: dict[str, np.ndarray]
    resampled: bool


def _piece(log: Stamped, part: slice, counts: np.ndarray, dt: float) -> _Piece:
    """Put one stretch without gap on its own grid."""
    stamps = log.t[part] - log.t[part.start]
    resampled = bool(np.abs(stamps - counts * dt).max() > _EXACT * dt)
    last = int(stamps[-1] / dt + _EXACT) if resampled else int(counts[-1])
    grid = np.arange(last + 1)
    at = stamps / dt if resampled else counts
    channels = {}
    for role, values in log.channels.items():
        if not resampled and len(grid) == len(counts):
            channels[role] = values[part]
        elif role in HELD and not resampled:
            channels[role] = values[part][np.searchsorted(counts, grid, side="right") - 1]
        elif role in HELD:
            channels[role] = held_mean(stamps, values[part], grid * dt, dt)
        elif role == "w":
            channels[role] = speed(at, counts, values[part], grid, resampled)
        else:
            channels[role] = between(role, at, values[part], grid)
    return _Piece(log.t[part.start] + grid * dt, channels, resampled)


def _resolution(log: Stamped, dt: float) -> dict[str, float]:
    """The smallest steps; that of a summed speed is given as theta's."""
    return {r: s if r in log.channels else s * dt for r, s in log.steps.items()}


def _joined(log: Stamped, pieces: list[_Piece], dt: float, filled: int) -> Record:
    said = list(log.said)
    if filled:
        said.append(
            f"{count(filled, 'sample')} missing between the stamps of t, filled in "
            "(u held, motion interpolated)."
        )
    sizes = np.cumsum([len(piece.t) for piece in pieces])
    gaps = tuple(int(g) for g in sizes[:-1])
    channels = {
        role: np.concatenate([piece.channels[role] for piece in pieces]) for role in log.channels
    }
    changed = log.dropped or filled or any(piece.resampled for piece in pieces)
    return Record(
        _onward([piece.t for piece in pieces], dt),
        **channels,
        dt=dt,
        motion=log.motion,
        source=log.source,
        file=None,
        log=None,
        dropped=log.dropped + filled,
        messages=tuple(said),
        gaps=gaps,
        resolution=_resolution(log, dt) if changed else {},
    )


def _onward(times: list[np.ndarray], dt: float) -> np.ndarray:
    """The times of all pieces; one whose clock starts again follows a second after the last."""
    made = times[:1]
    for t in times[1:]:
        end = made[-1][-1]
        made.append(t if t[0] > end else t - t[0] + end + max(1.0, 10 * dt))
    return np.concatenate(made)


def long_enough_to_judge(record: Record) -> None:
    """Raise Refused for a record that is too short or too slow to compare models on.

    The torque balance needs less: it answers beside the refusal.
    """
    parts = record.segments()
    most = max(p.stop - p.start for p in parts)
    samples, seconds = _TO_JUDGE
    if not plausible(record.dt):
        labels = record.log.labels if record.log is not None else {}
        raise Refused(
            f"{record.source}: {slow(record.rate, labels, _SLOW)}",
            "Record at 100 Hz or more.",
        )
    if most < samples or most * record.dt < seconds - record.dt / 2:
        whole = "" if len(parts) == 1 else " in its longest piece"
        raise Refused(
            f"{record.source} is too short to judge models by simulation: {most * record.dt:.4g} s "
            f"and {most} samples{whole}; at least {seconds:g} s and {samples} samples are needed.",
            "Record 20 s or more without loss.",
        )


def unlikely_time(record: Record) -> bool:
    """Whether t of a log has no unit, and no drive writes a log at that rate in s.

    All rates and the inertia depend on the unit of t. A record that was built of arrays is in s.
    """
    return record.log is not None and _open_time(record.log.labels, record.dt)


def _open_time(labels: Mapping[str, str | None], dt: float) -> bool:
    return labels.get("t", "s") is None and not plausible(dt)


def refuse_unlikely_time(record: Record) -> None:
    """Raise Refused, with the unit to state, for a log of :func:`unlikely_time`, and for one that
    is too short in its stated unit because no drive writes a log at that rate."""
    if record.log is not None:
        _refuse_stated_time(record, record.log.labels)
        refuse_open_time(record.source, record.log.labels, record.dt)


def refuse_open_time(source: str, labels: Mapping[str, str | None], dt: float) -> None:
    """Raise Refused where t has no unit and steps of ``dt`` are no s; ``labels`` are the units of
    the log by role."""
    if not _open_time(labels, dt):
        return
    finer = [u for u in UNITS.values() if u.quantity == "time" and u.factor < 1.0]
    unit = next((u.name for u in finer if plausible(dt * u.factor)), "ms")
    raise Refused(
        f"{source}: t has no unit, and read as s it gives a sampling rate of "
        f"{1.0 / dt:.6g} Hz, at which no drive writes a log: give "
        f"{option('units', f't={unit}')}, or {option('units', 't=s')} if that is right.",
        f"Write the unit of t into the header, as in t [{unit}].",
    )


def _refuse_stated_time(record: Record, labels: Mapping[str, str | None]) -> None:
    label = labels.get("t")
    seconds = record.samples * record.dt
    if label is None or plausible(record.dt) or seconds >= _TO_JUDGE[1]:
        return
    times = [u for u in UNITS.values() if u.quantity == "time"]
    taken = next(u.factor for u in times if u.name == label)
    other = next((u.name for u in times if plausible(record.dt * u.factor / taken)), None)
    if other is not None:
        raise Refused(
            f"{record.source}: t is stated in {label}, which gives a sampling rate of "
            f"{record.rate:.6g} Hz and a record of {seconds:.3g} s: give "
            f"{option('units', f't={other}')} if t is in {other}. If not, it is too short.",
            f"Write the unit of t into the header, as in t [{other}].",
        )
