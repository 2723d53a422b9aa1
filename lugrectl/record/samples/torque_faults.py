"""Torques that were not read: registers at their end or that wrap, readings that stand still. Their
values alone do not show it; the motion does: it needs another torque than the log says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..signal_noise import quantum
from .needed_torque import Needed, needed
from .rows import Stamped, count, in_runs, runs

_LONG = 6  # equal samples in a row that may be a stuck reading
_AT_LIMIT = 2  # the same on the end of the channel's range
_MOST = 0.6  # of the rows: a torque that stands longer is held on purpose
_FAR = 10.0  # times the usual error of the balance, to call a torque untrue
_SHARE = 0.02  # the same as a share of the torque
_SEGMENTS = 4000  # between jumps of a register; with more, its jumps are noise


# ---- readings that stand still ------------------------------------------------------


def leave_out_untrue_torque(log: Stamped) -> None:
    """Leave out torques that stand at one value while the motion needs another."""
    u, unit = log.channels["u"], log.unit_of_u
    if not np.isfinite(u).any() or len(log.required) < 2:
        return
    limit, stuck = _suspects(u)
    unknown = in_runs(len(u), [*limit, *stuck])
    if unknown.mean() > _MOST:
        stuck, unknown = [], in_runs(len(u), limit)
    if not 0 < unknown.mean() <= _MOST:
        return
    # fitted with the rows in doubt where that leaves little of the torque, else without: rests and
    # coasts are in doubt, too, and without them it may rest on little
    fit = needed(log)
    if fit is None or fit.scale >= _SHARE * float(np.nanquantile(np.abs(u), 0.9)):
        fit = needed(log, unknown)
    if fit is None:
        return
    least, missing = _least(fit, u, unknown), fit.missing(np.nan_to_num(u))
    for value, beyond in ((np.nanmin(u), -missing), (np.nanmax(u), missing)):
        at = in_runs(len(u), [run for run in limit if u[run[0]] == value])
        beyond = beyond[at & fit.judged]
        if len(beyond) >= 5 and np.quantile(beyond, 0.7) > least:
            ends = log.channels["u"] == value
            log.leave_out(
                "u",
                ends,
                f"u stays at the end of its register, {value:.6g} {unit}, {log.places(ends)}, "
                f"while the motion needs up to {np.max(beyond):.3g} {unit} more: left out.",
            )
    for a, n in stuck:
        judged = missing[a : a + n][fit.judged[a : a + n]]
        if n >= fit.width and len(judged) >= 5 and abs(np.median(judged)) > least:
            log.leave_out(
                "u",
                in_runs(len(log.t), [(a, n)]),
                f"u stands at {log.value('u', a)} for {count(n, 'row')} from {log.place(a)} on "
                f"while the motion needs {np.median(judged):+.3g} {unit} beyond it: left out.",
            )


def _suspects(u: np.ndarray) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return the runs of one value, (start, length): on the ends of the range, and long ones."""
    low, high = np.nanmin(u), np.nanmax(u)
    flat = [(a - 1, n + 1) for a, n in runs(np.r_[False, np.diff(u) == 0])]
    lengths = np.ones(len(u))
    for a, n in flat:
        lengths[a : a + n] = n
    usual = float(np.median(lengths))  # of the run that the typical row lies in
    limit = [(a, n) for a, n in flat if n >= _AT_LIMIT and u[a] in (low, high)]
    for end in (low, high):  # a held torque has an extreme, too
        if sum(n for a, n in limit if u[a] == end) < 5 * usual:
            limit = [(a, n) for a, n in limit if u[a] != end]
    long = max(_LONG, 5 * usual)
    return limit, [(a, n) for a, n in flat if n >= long and u[a] not in (low, high)]


def _least(fit: Needed, u: np.ndarray, unknown: np.ndarray) -> float:
    """Return the least missing torque that is no error of the rough balance."""
    missing = np.abs(fit.missing(u))
    away = fit.moving & np.isfinite(missing) & ~unknown
    if away.sum() < 30:
        return np.inf
    clean = away & (fit.averaged(unknown.astype(float)) < 0.02)
    usual = float(np.quantile(missing[clean], 0.95)) if clean.sum() > 30 else 0.0
    return max(_FAR * fit.scale, usual, _SHARE * float(np.nanquantile(np.abs(u), 0.9)))


# ---- registers that wrap ------------------------------------------------------------


def unwrap_torque(log: Stamped) -> None:
    """Add the multiples of a register's span that bring u to what the motion needs."""
    u = log.channels["u"]
    span = _span(u[np.isfinite(u)]) if np.isfinite(u).any() and len(log.required) > 1 else 0.0
    values = np.nan_to_num(u)
    steps = np.abs(np.diff(values))
    if not span or not (steps > span / 2).any():
        return
    # a jump of the torque that wraps may come out as a smaller one
    edges = np.flatnonzero(steps > max(span / 16, 10 * np.median(steps))) + 1
    ends = [0, *edges.tolist(), len(u)]
    segments = [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)]
    fit = needed(log) if 1 < len(segments) <= _SEGMENTS else None
    if fit is None:
        return
    turns = _turns(fit.torque - values, segments, values, span)
    moved = values + span * np.repeat(turns, np.diff(ends))
    changed = moved != values
    left, before = (np.nansum(np.abs(fit.missing(x)) / fit.error) for x in (moved, values))
    if not 0 < changed.mean() <= 0.5 or left > before:
        return
    log.say(
        f"u wraps by {span:.6g} {log.unit_of_u} {log.places(changed)} "
        f"({log.value('u', int(changed.argmax()))}), as the motion shows: unwrapped."
    )
    log.channels["u"] = np.where(np.isfinite(u), moved, np.nan)


def _span(values: np.ndarray) -> float:
    """Return the span of the register of a power of two steps that values fill; 0 for none."""
    step = quantum(values)
    if not step:
        return 0.0
    span = float(np.ptp(values)) + step
    power = step * 2.0 ** np.rint(np.log2(span / step))
    return float(power) if -1e-6 * span < power - span < 0.02 * span else 0.0


def _turns(
    missing: np.ndarray, segments: Sequence[slice], u: np.ndarray, span: float
) -> np.ndarray:
    """Return for each segment the multiple of the span that is missing there; the longest segment
    is as it was read."""
    turns = np.zeros(len(segments), int)
    jumps = [np.rint((u[s.start - 1] - u[s.start]) / span) for s in segments[1:]]
    known = [i for i, part in enumerate(segments) if np.isfinite(missing[part]).any()]
    for i in known:
        turns[i] = np.rint(np.nanmedian(missing[segments[i]]) / span)
    for i in range(known[0] - 1, -1, -1):  # beyond the windows: the smallest jump
        turns[i] = turns[i + 1] - jumps[i]
    for i in range(known[-1] + 1, len(segments)):
        turns[i] = turns[i - 1] + jumps[i - 1]
    return turns - turns[int(np.argmax([part.stop - part.start for part in segments]))]
