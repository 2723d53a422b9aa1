"""Uniform time: recorded stamps and missing samples become one step ``dt``, with gaps marked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import Refused
from .resampling import HELD, MOTION, between, held_mean, speed
from .samples import Record, smallest_step

MIN_SAMPLES = 200
MIN_SECONDS = 1.0
_RATES = (5.0, 5e5)  # Hz; outside, the time unit is wrong or the log is no servo log
_FILL = 3  # longest run of missing samples that is filled
_FILL_SHARE = 0.01  # largest share of missing samples that is filled
_STRETCH = 20  # samples; shorter stretches between gaps are left out
_EXACT = 0.01  # stamps this close to the grid (in dt) count as on it
_JITTER = 0.2  # stamps this irregular (in dt) can still be resampled


@dataclass
class Stamped:
    """Channels with their recorded stamps (s) on the way to uniform time."""

    source: str
    t: np.ndarray
    channels: dict[str, np.ndarray]
    where: Callable[[int], str]  # describes the place of a row in the file
    rows: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    dropped: int = 0
    said: list[str] = field(default_factory=list)
    steps: dict[str, float] = field(default_factory=dict)  # the smallest recorded, by role

    def __post_init__(self) -> None:
        self.rows = np.arange(len(self.t))

    def keep(self, mask: np.ndarray) -> None:
        self.t, self.rows = self.t[mask], self.rows[mask]
        self.channels = {role: values[mask] for role, values in self.channels.items()}


def uniform(log: Stamped, required: tuple[str, ...], motion: str) -> Record:
    """Bring a log, in SI units, to uniform time.

    Up to 3 missing samples in a row (less than 1 % in all) are filled, repeated stamps are
    merged, and stamps that jitter by up to 20 % of the step are resampled; a longer loss
    becomes a gap. A held channel keeps its time integral, motion is interpolated by cubic
    splines (a speed that is the difference of a position: via that position), temperature
    linearly.

    Raises Refused when the record is too short or its time cannot be repaired.
    """
    _long_enough(log, len(log.t))
    log.steps = _smallest_steps(log)
    _fill_missing(log, required)
    _forward(log)
    _merge_doubles(log)
    return _regular(log, motion)


def even(record: Record) -> Record:
    """The record on uniform time; :func:`uniform` is applied if its stamps are not even."""
    steps = np.delete(np.diff(record.t), np.array(record.gaps, int) - 1)
    if np.abs(steps / record.dt - 1).max(initial=0.0) <= _EXACT:
        return record
    channels = record.channels()
    required = tuple(role for role in ("u", "w", "theta") if role in channels)
    log = Stamped(record.source, channels.pop("t"), channels, "sample {}".format)
    made = uniform(log, required, record.motion)
    return replace(
        made, messages=(*record.messages, *made.messages), dropped=record.dropped + made.dropped
    )


def _smallest_steps(log: Stamped) -> dict[str, float]:
    """Smallest steps of the motion channels; without theta, that of the summed w in its place."""
    motion = {r: x for r, x in log.channels.items() if r in MOTION}
    if "theta" not in motion and "w" in motion:
        motion["theta"] = np.cumsum(np.nan_to_num(motion["w"], posinf=0.0, neginf=0.0))
    return {r: smallest_step(x) for r, x in motion.items()}


def _long_enough(log: Stamped, samples: int) -> None:
    if samples < MIN_SAMPLES:
        raise Refused(
            f"{log.source} is too short: {_count(samples, 'sample')}; "
            f"at least {MIN_SAMPLES} are needed.",
            f"Record at least {MIN_SECONDS:g} s, better 20 s or more, with {MIN_SAMPLES} samples.",
        )


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return (start, length) of every run of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False]))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _fill_missing(log: Stamped, required: tuple[str, ...]) -> None:
    lost = ~np.isfinite(log.t)
    if lost.any():
        _fillable(log, "t", lost)
        log.said.append(f"t is missing in {_count(lost.sum(), 'row')}: left out.")
        log.keep(~lost)
    affected = np.zeros(len(log.t), bool)
    for role, values in list(log.channels.items()):
        lost = ~np.isfinite(values)
        if not lost.any():
            continue
        if role in required:
            _fillable(log, role, lost)
        elif lost.all() or (role != "temperature" and not _isolated(lost)):
            del log.channels[role]
            log.said.append(f"{role} has too many missing samples and is left out.")
            continue
        log.channels[role] = _filled(role, log.t, values, lost)
        affected |= lost if role in required else False
        how = "held" if role in HELD else "interpolated"
        log.said.append(f"{role} is missing in {_count(lost.sum(), 'sample')}: filled in ({how}).")
    log.dropped += int(affected.sum())


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _isolated(lost: np.ndarray) -> bool:
    longest = max(length for _, length in _runs(lost))
    return longest <= _FILL and lost.mean() < _FILL_SHARE


def _fillable(log: Stamped, role: str, lost: np.ndarray) -> None:
    if _isolated(lost):
        return
    start, length = max(_runs(lost), key=lambda run: run[1])
    raise Refused(
        f"{log.source}: {role} has no number in {_count(int(lost.sum()), 'sample')}, "
        f"the longest run being {length} from {log.where(int(log.rows[start]))} on; "
        "cut the record there or record it again."
    )


def _filled(role: str, t: np.ndarray, values: np.ndarray, lost: np.ndarray) -> np.ndarray:
    good = np.flatnonzero(~lost)
    if role in HELD:
        before = np.searchsorted(good, np.arange(len(t)), side="right") - 1
        return values[good[np.maximum(before, 0)]]
    return between(role, good, values[good], np.arange(len(t)))


def _forward(log: Stamped) -> None:
    back = np.flatnonzero(np.diff(log.t) < 0)
    if back.size:
        k = int(back[0])
        raise Refused(
            f"{log.source}: time goes backwards at {log.where(int(log.rows[k + 1]))} "
            f"(from {log.t[k]:.9g} s to {log.t[k + 1]:.9g} s); "
            "cut the record there or give the parts as separate files."
        )


def _merge_doubles(log: Stamped) -> None:
    """Merge rows of one stamp: the last value of a held channel, the mean of the others."""
    first = np.r_[True, np.diff(log.t) > 0]
    if first.all():
        return
    starts = np.flatnonzero(first)
    counts = np.diff(np.r_[starts, len(first)])
    channels = {}
    for role, values in log.channels.items():
        if role in HELD:
            channels[role] = values[starts + counts - 1]
        else:
            channels[role] = np.add.reduceat(values, starts) / counts
    merged = len(first) - len(starts)
    log.t, log.rows, log.channels = log.t[starts], log.rows[starts], channels
    log.dropped += merged
    log.said.append(f"t is repeated in {_count(merged, 'row')}: merged into one per time stamp.")
    _long_enough(log, len(log.t))


def _regular(log: Stamped, motion: str) -> Record:
    _even_out(log)
    steps = np.diff(log.t)
    dt = float(np.median(steps))
    _plausible(log, dt)
    cuts = np.flatnonzero(steps > (_FILL + 1.5) * dt) + 1
    parts = [slice(a, b) for a, b in zip(np.r_[0, cuts], np.r_[cuts, len(log.t)], strict=True)]
    parts = _long_parts(log, parts)
    counts = [np.r_[0, np.cumsum(_multiples(steps[p.start : p.stop - 1], dt))] for p in parts]
    ticks = sum(int(n[-1]) for n in counts)
    dt = _nice(float(sum(log.t[p.stop - 1] - log.t[p.start] for p in parts)) / max(ticks, 1))
    filled = ticks - sum(len(n) - 1 for n in counts)
    _check(log, parts, dt, filled)
    pieces = [_piece(log, p, n, dt) for p, n in zip(parts, counts, strict=True)]
    return _joined(log, motion, pieces, dt, filled)


def _even_out(log: Stamped) -> None:
    if not _rounded(log.t):
        return
    grid = np.arange(len(log.t))
    dt = _nice(float(np.polyfit(grid, log.t - log.t[0], 1)[0]))
    log.t = log.t[0] + dt * grid
    log.said.append(f"t is rounded coarsely relative to its step: {dt:.6g} s was used throughout.")


def _long_parts(log: Stamped, parts: list[slice]) -> list[slice]:
    """Leave out stretches between gaps that are too short to be useful."""
    kept = [p for p in parts if p.stop - p.start >= _STRETCH]
    lost = len(log.t) - sum(p.stop - p.start for p in kept)
    if kept and lost:
        log.dropped += lost
        log.said.append(
            f"{_count(lost, 'sample')} in stretches shorter than {_STRETCH} samples "
            "between gaps were left out."
        )
    return kept or parts[:1]


def _nice(dt: float) -> float:
    """Remove the last digits, which are rounding of the stamps."""
    short = float(f"{dt:.6g}")
    return short if abs(short - dt) < 1e-9 * dt else float(f"{dt:.12g}")


def _multiples(steps: np.ndarray, dt: float) -> np.ndarray:
    return np.maximum(np.rint(steps / dt), 1).astype(int)


def _rounded(t: np.ndarray) -> bool:
    """Whether the stamps are an even grid rounded to few digits, without jitter or loss."""
    steps = np.diff(t)
    typical, spread = np.median(steps), np.ptp(steps)
    if spread < 2 * _EXACT * typical or steps.max() > 4 * typical:
        return False
    _, shares = np.unique(np.rint(steps / (_EXACT * typical)), return_counts=True)
    if len(shares) != 2 or shares.min() < 2 * _FILL_SHARE * len(steps):
        return False
    grid, since = np.arange(len(t)), t - t[0]
    error = since - np.polyval(np.polyfit(grid, since, 1), grid)
    return bool(np.abs(error).max() < 0.55 * spread)


def _plausible(log: Stamped, dt: float) -> None:
    low, high = _RATES
    if low <= 1 / dt < high:
        return
    problem = "too slow for friction" if 1 / dt < low else "not plausible"
    raise Refused(
        f"{log.source}: t gives a sampling rate of {1 / dt:.6g} Hz, {problem}; "
        "if t is not in the stated or assumed unit, give its unit, e.g. --units t=ms (or s, us).",
    )


def _check(log: Stamped, parts: list[slice], dt: float, filled: int) -> None:
    """Refuse a time that is too short, has too many losses or is too irregular."""
    steps = np.diff(log.t)
    at = np.flatnonzero(steps < (_FILL + 1.5) * dt)
    jitter = np.abs(steps[at] / dt - _multiples(steps[at], dt))
    if not len(at) or np.quantile(jitter, 0.99) > _JITTER:
        row = int(log.rows[at[np.argmax(jitter)] + 1]) if len(at) else 1
        raise Refused(
            f"{log.source}: t is too irregular to repair: its steps vary from {steps.min():.4g} s "
            f"to {steps.max():.4g} s about {dt:.4g} s, worst at {log.where(row)}.",
            "Record at a fixed rate.",
        )
    longest = float(max(log.t[p.stop - 1] - log.t[p.start] for p in parts)) + dt
    most = max(p.stop - p.start for p in parts)
    if longest < MIN_SECONDS - dt / 2 or most < MIN_SAMPLES:
        whole = "" if most == len(log.t) else " between lost samples"
        raise Refused(
            f"{log.source} is too short: {longest:.4g} s and {most} samples{whole}; "
            f"at least {MIN_SECONDS:g} s and {MIN_SAMPLES} samples are needed.",
            "Record 20 s or more without loss.",
        )
    if filled > max(_FILL_SHARE * len(log.t), _FILL):
        raise Refused(
            f"{log.source}: {filled} of {len(log.t) + filled} samples are missing, a few at a "
            f"time throughout; at most {100 * _FILL_SHARE:g} % can be filled in.",
            "Record without loss.",
        )


@dataclass(frozen=True)
class _Piece:
    t: np.ndarray
    channels: dict[str, np.ndarray]
    resampled: bool
    jitter: float


def _piece(log: Stamped, part: slice, counts: np.ndarray, dt: float) -> _Piece:
    """Put one stretch without gap on its own grid."""
    stamps = log.t[part] - log.t[part.start]
    resampled = bool(np.abs(stamps - counts * dt).max() > _EXACT * dt)
    jitter = np.abs(np.diff(stamps) / dt - np.diff(counts)).max(initial=0.0)
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
    return _Piece(log.t[part.start] + grid * dt, channels, resampled, float(jitter))


def _resolution(log: Stamped, dt: float) -> dict[str, float]:
    """The smallest steps; that of a summed speed is given as theta's."""
    return {r: s if r in log.channels else s * dt for r, s in log.steps.items()}


def _joined(log: Stamped, motion: str, pieces: list[_Piece], dt: float, filled: int) -> Record:
    said = list(log.said)
    if filled:
        said.append(
            f"{_count(filled, 'sample')} missing between the stamps of t, filled in "
            "(u held, motion interpolated)."
        )
    resampled = any(piece.resampled for piece in pieces)
    if resampled:
        said.append(
            f"t jitters by up to {100 * max(p.jitter for p in pieces):.2g} % of its step of "
            f"{dt:.6g} s: resampled to an even step (u held, motion interpolated)."
        )
    sizes = np.cumsum([len(piece.t) for piece in pieces])
    gaps = tuple(int(g) for g in sizes[:-1])
    t = np.concatenate([piece.t for piece in pieces])
    if gaps:
        lost = round(sum(t[g] - t[g - 1] - dt for g in gaps) / dt)
        said.append(
            f"About {lost} samples are lost in {_count(len(gaps), 'gap')}, the first at "
            f"t = {t[gaps[0] - 1]:.6g} s; the parts are treated separately."
        )
    channels = {
        role: np.concatenate([piece.channels[role] for piece in pieces]) for role in log.channels
    }
    return Record(
        t,
        **channels,
        dt=dt,
        motion=motion,
        source=log.source,
        file=None,
        dropped=log.dropped + filled,
        messages=tuple(said),
        gaps=gaps,
        resolution=_resolution(log, dt) if log.dropped or filled or resampled else {},
    )
