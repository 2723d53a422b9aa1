"""Torques that were not read: registers at their end or that wrap, readings that stand still.

Their values alone do not show it, since a drive may hold its torque or jump with it. The motion
does: it needs another torque than the log says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..columns.units import si_unit
from .needed_torque import Needed, needed
from .outliers import quantum
from .rows import Stamped, count, runs

_LONG = 6  # equal samples in a row that may be a stuck reading
_AT_LIMIT = 2  # the same on the end of the channel's range
_MOST = 0.6  # of the rows: a torque that stands longer is held on purpose
_FAR = 10.0  # times the usual error of the balance, to call a torque untrue
_SHARE = 0.02  # the same as a share of the torque
_TURNS = 2  # spans of a register that a torque may be beyond it
_ROUNDS = 8  # of the assignment of spans
_SEGMENTS = 4000  # between jumps of a register; with more, its jumps are noise


# ---- readings that stand still ------------------------------------------------------


def leave_out_untrue_torque(log: Stamped) -> None:
    """Leave out torques that stand at one value while the motion needs another."""
    u = log.channels["u"]
    if not np.isfinite(u).any() or len(log.required) < 2:
        return
    low, high = np.nanmin(u), np.nanmax(u)
    same = np.r_[False, np.diff(u) == 0]
    flat = [(a - 1, n + 1) for a, n in runs(same)]
    usual = _usual(flat, len(u))
    limit = [(a, n) for a, n in flat if n >= _AT_LIMIT and u[a] in (low, high)]
    for end in (low, high):  # a held torque has an extreme, too
        if sum(n for a, n in limit if u[a] == end) < 5 * usual:
            limit = [(a, n) for a, n in limit if u[a] != end]
    stuck = [(a, n) for a, n in flat if n >= _LONG and u[a] not in (low, high)]
    stuck = [(a, n) for a, n in stuck if n >= 5 * usual]
    if not limit and not stuck:
        return
    unknown = _rows(len(u), [*limit, *stuck])
    if unknown.mean() > _MOST:
        stuck, unknown = [], _rows(len(u), limit)
    if not unknown.any() or unknown.mean() > _MOST:
        return
    fit = _judging(log, unknown)
    if fit is None:
        return
    least = _least(fit, u, unknown)
    missing = fit.missing(np.nan_to_num(u))
    for value, beyond in ((low, -missing), (high, missing)):
        at = _rows(len(u), [run for run in limit if u[run[0]] == value])
        _saturated(log, value, beyond[at & fit.judged], least)
    _stuck(log, fit, missing, stuck, least)


def _judging(log: Stamped, unknown: np.ndarray) -> Needed | None:
    """The balance that judges rows in doubt: fitted with them where it then leaves little of the
    torque, however far off single rows are, else without. Rests and coasts are in doubt, too, and
    without them it may rest on little."""
    every = needed(log)
    little = _SHARE * float(np.nanquantile(np.abs(log.channels["u"]), 0.9))
    return every if every is not None and every.scale < little else needed(log, unknown)


def _usual(flat: Sequence[tuple[int, int]], rows: int) -> float:
    """The length of the run that the typical row lies in."""
    lengths = np.ones(rows)
    for a, n in flat:
        lengths[a : a + n] = n
    return float(np.median(lengths))


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
        judged = missing[a : a + n][fit.judged[a : a + n]]
        if n < fit.width or len(judged) < 5 or not abs(np.median(judged)) > least:
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


@dataclass(frozen=True, eq=False)
class Register:
    """The torque of a register, in segments between its jumps.

    A segment is a number of spans away from what was read. How likely that is, in nats: by the
    motion, which needs a torque up to an error; by the changes of u from row to row, which are of
    the usual size or, seldom, any; and by the chance of a wrap, once in the rows of the log.
    """

    fit: Needed
    u: np.ndarray
    segments: Sequence[slice]
    span: float
    change: float  # usual change of u from row to row

    def moved(self, turns: np.ndarray) -> np.ndarray:
        return _shifted(self.u, self.segments, turns, self.span)

    def cost(self, turns: np.ndarray) -> float:
        """What these numbers of spans cost."""
        moved = self.moved(turns)
        jumps = [self.jump(moved, part.start) for part in self.segments[1:]]
        return self.misfit(self.fit.missing(moved), slice(None)) + sum(jumps) + self.rare(turns)

    def misfit(self, missing: np.ndarray, rows: slice) -> float:
        """Of the motion; neighbouring windows share their rows."""
        return float(np.nansum(np.abs(missing) / self.fit.error[rows])) / self.fit.width

    def jump(self, u: np.ndarray, row: int, more: float = 0.0) -> float:
        """Of the change of u to a row; 0 where there is no row before it."""
        if not 0 < row < len(u):
            return 0.0
        return float(np.log1p(((u[row] - u[row - 1] + more) / self.change) ** 2))

    def rare(self, turns: np.ndarray) -> float:
        return float(np.count_nonzero(turns) * np.log(len(self.u)))


def unwrap_torque(log: Stamped) -> None:
    """Add the multiples of a register's span that bring u to what the motion needs."""
    u = log.channels["u"]
    span = _span(u) if np.isfinite(u).any() and len(log.required) > 1 else 0.0
    steps = np.abs(np.diff(np.nan_to_num(u)))
    if not span or not (steps > span / 2).any():
        return
    # a jump of the torque that wraps may come out as a smaller one
    edges = np.flatnonzero(steps > max(span / 16, 10 * np.median(steps))) + 1
    if not 0 < len(edges) < _SEGMENTS:
        return
    segments = [slice(int(a), int(b)) for a, b in zip([0, *edges], [*edges, len(u)], strict=True)]
    fit = needed(log)
    if fit is None:
        return
    usual = max(float(np.median(steps)), quantum(u[np.isfinite(u)]))
    register = Register(fit, np.nan_to_num(u), segments, span, usual)
    turns = _nearest(fit, u, segments, span)
    for _ in range(_ROUNDS):
        before = turns
        turns = _assigned(register, turns)
        if (turns == before).all():
            break
    turns -= turns[int(np.argmax([s.stop - s.start for s in segments]))]
    moved = register.moved(turns)
    changed = moved != register.u
    if not changed.any() or changed.mean() > 0.5:
        return
    if register.cost(turns) > register.cost(0 * turns):
        return
    first, unit = int(changed.argmax()), si_unit("u", log.motion)
    log.say(
        f"u wraps by {span:.6g} {unit} in {count(int(changed.sum()), 'row')}, first at "
        f"{log.place(first)} ({log.value('u', first)}), as the motion shows: unwrapped."
    )
    log.channels["u"] = np.where(np.isfinite(u), moved, np.nan)


def _span(u: np.ndarray) -> float:
    """The span of the register of a power of two steps that the values of u fill; 0 for none."""
    good = u[np.isfinite(u)]
    step = quantum(good)
    if not step:
        return 0.0
    span = float(np.ptp(good)) + step
    power = step * 2.0 ** np.rint(np.log2(span / step))
    return float(power) if -1e-6 * span < power - span < 0.02 * span else 0.0


def _shifted(
    u: np.ndarray, segments: Sequence[slice], turns: np.ndarray, span: float
) -> np.ndarray:
    made = np.nan_to_num(u)
    for part, n in zip(segments, turns, strict=True):
        made[part] += n * span
    return made


def _nearest(fit: Needed, u: np.ndarray, segments: Sequence[slice], span: float) -> np.ndarray:
    """For each segment the multiple that brings it next to what the motion needs about it."""
    made, values = np.zeros(len(segments), int), np.nan_to_num(u)
    missing = fit.torque - values
    known = [i for i, part in enumerate(segments) if np.isfinite(missing[part]).any()]
    for i in known:
        made[i] = np.rint(np.nanmedian(missing[segments[i]]) / span)
    for i in range(known[0] - 1, -1, -1):  # beyond the windows: the smallest jump
        end, then = values[segments[i].stop - 1], values[segments[i].stop]
        made[i] = made[i + 1] + np.rint((then - end) / span)
    for i in range(known[-1] + 1, len(segments)):
        end, then = values[segments[i].start - 1], values[segments[i].start]
        made[i] = made[i - 1] + np.rint((end - then) / span)
    return made


def _assigned(register: Register, turns: np.ndarray) -> np.ndarray:
    """For each segment the multiple that costs least, the others as they are."""
    made, fit, span = turns.copy(), register.fit, register.span
    moved = register.moved(turns)
    missing = fit.missing(moved)
    for i, part in enumerate(register.segments):
        a = max(part.start - 2 * fit.width, 0)
        b = min(part.stop + 2 * fit.width, len(moved))
        mine = np.zeros(b - a)
        mine[part.start - a : part.stop - a] = span
        share = np.convolve(mine, fit.kernel, "same")
        rows, costs = slice(a, b), {}
        for n in range(-_TURNS - made[i], _TURNS + 1 - made[i]):
            costs[n] = register.misfit(missing[rows] - n * share, rows)
            costs[n] += register.jump(moved, part.start, n * span)
            costs[n] += register.jump(moved, part.stop, -n * span)
            costs[n] += register.rare(np.array([made[i] + n]))
        n = min(costs, key=lambda n: (costs[n], abs(n)))
        made[i] += n
        missing[rows] -= n * share
        moved[part] += n * span
    return made
