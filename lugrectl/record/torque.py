"""Torques that were not read: registers at their end or that wrap, readings that stand still.

Their values alone do not show it, since a drive may hold its torque or jump with it. The motion
does: it needs another torque than the log says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .needed import Needed, needed
from .outliers import quantum
from .stamped import Stamped, count, runs
from .units import si_unit

_LONG = 6  # equal samples in a row that may be a stuck reading
_AT_LIMIT = 2  # the same on the end of the channel's range
_MOST = 0.6  # of the rows: a torque that stands longer is held on purpose
_FAR = 10.0  # times the usual error of the balance, to call a torque untrue
_SHARE = 0.02  # the same as a share of the torque
_SEGMENTS = 4000  # between jumps of a register; with more, its jumps are noise


def leave_out_untrue_torque(log: Stamped) -> None:
    """Leave out torques that the motion contradicts; undo the wraps of a register."""
    u = log.channels["u"]
    if not np.isfinite(u).any() or len(log.required) < 2:
        return
    _unwrap_register(log)
    _leave_out_flat(log)


# ---- readings that stand still ------------------------------------------------------


def _leave_out_flat(log: Stamped) -> None:
    u = log.channels["u"]
    low, high = np.nanmin(u), np.nanmax(u)
    same = np.r_[False, np.diff(u) == 0]
    flat = [(a - 1, n + 1) for a, n in runs(same)]
    usual = _usual(flat, len(u))
    limit = [(a, n) for a, n in flat if n >= _AT_LIMIT and u[a] in (low, high)]
    for end in (low, high):  # a held torque has an extreme, too
        if sum(n for a, n in limit if u[a] == end) < 5 * usual:
            limit = [(a, n) for a, n in limit if u[a] != end]
    stuck = [(a, n) for a, n in flat if n >= _LONG and u[a] not in (low, high)]
    stuck = [(a, n) for a, n in stuck if n >= 5 * usual and _jumps(u, a, n)]
    if not limit and not stuck:
        return
    unknown = _rows(len(u), [*limit, *stuck])
    if unknown.mean() > _MOST:
        stuck, unknown = [], _rows(len(u), limit)
    if not unknown.any() or unknown.mean() > _MOST:
        return
    fit = needed(log, unknown)
    if fit is None:
        return
    least = _least(fit, u, unknown)
    missing = fit.missing(np.nan_to_num(u))
    for value, beyond in ((low, -missing), (high, missing)):
        at = _rows(len(u), [run for run in limit if u[run[0]] == value])
        _saturated(log, value, beyond[at & fit.moving], least)
    _stuck(log, fit, missing, stuck, least)


def _usual(flat: Sequence[tuple[int, int]], rows: int) -> float:
    """The length of the run that the typical row lies in."""
    lengths = np.ones(rows)
    for a, n in flat:
        lengths[a : a + n] = n
    return float(np.median(lengths))


def _jumps(u: np.ndarray, a: int, n: int) -> bool:
    """Whether a run of one value begins or ends with a step like no other near it."""
    before, after = np.abs(np.diff(u[max(a - 12, 0) : a + 1])), np.abs(np.diff(u[a + n - 1 :][:13]))
    own = max(before[-1:].max(initial=0.0), after[:1].max(initial=0.0))
    others = max(np.nanmax(before[:-1], initial=0.0), np.nanmax(after[1:], initial=0.0))
    return bool(own > 3 * others)


def _rows(number: int, found: Sequence[tuple[int, int]]) -> np.ndarray:
    made = np.zeros(number, bool)
    for a, n in found:
        made[a : a + n] = True
    return made


def _least(fit: Needed, u: np.ndarray, unknown: np.ndarray) -> float:
    """The least missing torque that is no error of the rough balance."""
    away = fit.moving & np.isfinite(fit.missing(u)) & ~unknown
    spread = np.nanquantile(np.abs(u), 0.9)
    if away.sum() < 30:
        return np.inf
    near = fit.averaged(unknown.astype(float))
    clean = away & (near < 0.02)
    usual = np.quantile(np.abs(fit.missing(u)[clean]), 0.95) if clean.sum() > 30 else 0.0
    return max(_FAR * fit.scale, float(usual), _SHARE * float(spread))


def _saturated(log: Stamped, value: float, beyond: np.ndarray, least: float) -> None:
    """Leave out the end of a register, where the motion needs a torque ``beyond`` it."""
    if len(beyond) < 5 or not np.quantile(beyond, 0.7) > least:
        return
    u = log.channels["u"]
    every = u == value
    first = int(every.argmax())
    unit = si_unit("u", log.motion)
    log.say(
        f"u stays at the end of its register, {value:.6g} {unit}, in "
        f"{count(int(every.sum()), 'row')}, first at {log.place(first)}, while the motion needs "
        f"up to {np.max(beyond):.3g} {unit} more: left out."
    )
    _without(log, every)


def _stuck(
    log: Stamped,
    fit: Needed,
    missing: np.ndarray,
    found: Sequence[tuple[int, int]],
    least: float,
) -> None:
    """Leave out runs of one value that the motion contradicts."""
    for a, n in found:
        judged = missing[a : a + n][fit.moving[a : a + n]]
        if len(judged) < max(5, 0.3 * n) or not abs(np.median(judged)) > least:
            continue
        log.say(
            f"u stands at {log.value('u', a)} for {count(n, 'row')} from {log.place(a)} on while "
            f"the motion needs {np.median(judged):+.3g} {si_unit('u', log.motion)} beyond it: "
            "left out."
        )
        _without(log, _rows(len(missing), [(a, n)]))


def _without(log: Stamped, bad: np.ndarray) -> None:
    values = log.channels["u"].copy()
    values[bad] = np.nan
    log.channels["u"] = values


# ---- registers that wrap ------------------------------------------------------------


def _unwrap_register(log: Stamped) -> None:
    """Add the multiples of the register's span that bring u to what the motion needs."""
    u = log.channels["u"]
    span = _span(u)
    edges = np.flatnonzero(np.abs(np.diff(np.nan_to_num(u))) > span / 2) + 1 if span else []
    if not 0 < len(edges) < _SEGMENTS:
        return
    segments = [slice(int(a), int(b)) for a, b in zip([0, *edges], [*edges, len(u)], strict=True)]
    fit = needed(log)
    if fit is None:
        return
    turns = np.zeros(len(segments), int)
    for _ in range(3):
        turns = _assigned(fit, u, segments, turns, span)
    turns -= turns[int(np.argmax([s.stop - s.start for s in segments]))]
    moved = _shifted(u, segments, turns, span)
    changed = moved != np.nan_to_num(u)
    if not changed.any() or changed.mean() > 0.5 or not _nearer(fit, u, moved, changed):
        return
    first, unit = int(changed.argmax()), si_unit("u", log.motion)
    log.say(
        f"u wraps by {span:.6g} {unit} in {count(int(changed.sum()), 'row')}, first at "
        f"{log.place(first)} ({log.value('u', first)}), as the motion shows: unwrapped."
    )
    log.channels["u"] = np.where(np.isfinite(u), moved, np.nan)


def _span(u: np.ndarray) -> float:
    """The span of the register if u lies on a lattice that fills it; 0 otherwise."""
    good = u[np.isfinite(u)]
    step = quantum(good)
    if not step:
        return 0.0
    span = float(np.ptp(good)) + step
    power = step * 2.0 ** np.rint(np.log2(span / step))
    return float(power) if abs(power - span) < 0.02 * span else span


def _shifted(
    u: np.ndarray, segments: Sequence[slice], turns: np.ndarray, span: float
) -> np.ndarray:
    made = np.nan_to_num(u)
    for part, n in zip(segments, turns, strict=True):
        made[part] += n * span
    return made


def _assigned(
    fit: Needed, u: np.ndarray, segments: Sequence[slice], turns: np.ndarray, span: float
) -> np.ndarray:
    """For each segment the multiple that agrees best with the motion, the others as they are."""
    made, reach = turns.copy(), fit.width
    missing = fit.missing(_shifted(u, segments, turns, span))
    for i, part in enumerate(segments):
        if part.stop - part.start > 10 * reach:
            continue
        a, b = max(part.start - 2 * reach, 0), min(part.stop + 2 * reach, len(u))
        mine = np.zeros(b - a)
        mine[part.start - a : part.stop - a] = span
        share = np.convolve(mine, fit.kernel, "same")
        near = missing[a:b]
        good = np.isfinite(near)
        if not good.any():
            continue
        tries = range(-2, 3)
        costs = [np.abs(near[good] - n * share[good]).sum() for n in tries]
        n = tries[int(np.argmin(costs))]
        made[i] += n
        missing[a:b] = near - n * share
    return made


def _nearer(fit: Needed, u: np.ndarray, moved: np.ndarray, changed: np.ndarray) -> bool:
    """Whether the balance is met much better with the other torque, where it differs."""
    touched = fit.averaged(changed.astype(float)) > 0.05
    before, after = (np.abs(fit.missing(x))[touched] for x in (np.nan_to_num(u), moved))
    return bool(len(before) and np.nansum(after) < 0.4 * np.nansum(before))
