"""Positions without jumps: wrapped angles and counters unwrapped, pasted runs cut, and motion that
stands still in the log while the drive goes on left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ...core.unit_names import si_unit
from ..signal_noise import quantum, repeats, resolution
from .clock import usual_step
from .outliers import OFF, confirmed, distances, leave_out, limits, over_loss
from .rows import Stamped, count

_TURNS = 16  # most turns after which a counter wraps (57 turns would look like 360 deg)
_TURN = 2 * np.pi
_SMALL = 1 / 3  # of the period, largest step beside which a wrap (above two thirds) is plain
_BRIEF = 4  # rows that may be off together
_BITS = (8, 10, 12, 14, 15, 16, 18, 20, 24, 31, 32)  # of counters
_FEWEST = 3  # equal samples in a row that may be a stuck sensor
_LONG = 20  # the same of a speed, whose noise never stops


@dataclass(frozen=True, eq=False)
class Jumps:
    """Steps of a position that are no motion: between good row ``a`` and good row ``b``, ``size``
    beyond the motion around; ``steady``: one speed on both sides, not 0; ``pace`` is that, per
    row."""

    a: np.ndarray
    b: np.ndarray
    size: np.ndarray
    steady: np.ndarray
    pace: np.ndarray
    resolution: float

    def __len__(self) -> int:
        return len(self.a)

    def only(self, which: np.ndarray) -> Jumps:
        some = {k: getattr(self, k)[which] for k in ("a", "b", "size", "steady", "pace")}
        return replace(self, **some)

    @property
    def margin(self) -> np.ndarray:
        """How exactly each size is known."""
        return 2 * self.pace + 4 * self.resolution


def jumps(t: np.ndarray, x: np.ndarray) -> Jumps:
    """Find the steps of a position (N,) that its speed on either side does not explain."""
    good = np.flatnonzero(np.isfinite(x))
    if len(good) < 16:
        none = np.empty(0)
        return Jumps(good[:0], good[:0], none, none.astype(bool), none, 0.0)
    values, dt = x[good], usual_step(t) or 1.0
    elapsed = np.maximum(np.diff(t[good]) / dt, 1.0)
    speed = np.diff(values) / elapsed
    far = distances(np.arange(len(speed), dtype=float), speed)
    quiet = resolution(values)
    limit = limits("theta", speed) + 6 * quiet + 3 * np.quantile(far, 0.97)
    at = np.flatnonzero(far > limit)
    calm = speed.copy()
    calm[at] = np.nan
    before, after = _medians(calm, at)
    usual = np.nan_to_num(np.where(np.isfinite(before), before, after))
    usual = np.where(np.isfinite(after) & np.isfinite(before), (before + after) / 2, usual)
    steady = np.abs(before - after) <= 0.3 * np.abs(usual) + quiet
    steady &= np.abs(usual) > max(0.5 * quiet, 1e-9 * np.ptp(values))
    size = np.diff(values)[at] - usual * elapsed[at]
    return Jumps(good[at], good[at + 1], size, steady, np.abs(usual), quiet)


def _jumps(log: Stamped, role: str) -> Jumps:
    """Return the jumps of a channel; searched for again only where it or its stamps changed."""
    t, x = log.t, log.channels[role]
    known = log.known.get(role)
    if known is None or known[0] is not t or known[1] is not x:
        known = log.known[role] = (t, x, jumps(t, x))
    return known[2]


def _medians(x: np.ndarray, at: np.ndarray) -> list[np.ndarray]:
    """Return the medians of up to four values before and after each place; nan without any."""
    around, sides = sliding_window_view(np.pad(x, 4, constant_values=np.nan), 9)[at], []
    for values in (around[:, :4], around[:, 5:]):
        some = np.isfinite(values).any(1)
        medians = np.full(len(at), np.nan)
        medians[some] = np.nanmedian(values[some], axis=1)
        sides.append(medians)
    return sides


# ---- wrapped positions --------------------------------------------------------------


def unwrap_positions(log: Stamped) -> None:
    for role in ("theta", "theta_load"):
        if role in log.channels:
            log.channels[role], said = unwrapped(
                role, log.channels[role], _jumps(log, role), log.motion, log.labels.get(role)
            )
            log.say(*said)


def unwrapped(
    role: str, theta: np.ndarray, found: Jumps, motion: str, label: str | None = None
) -> tuple[np.ndarray, list[str]]:
    """Return a position without wraps, by whole turns, a power of two of its steps, or any period
    of all jumps that span its range in motion; and a sentence if there were any."""
    back = (found.b[1:] - found.a[:-1] <= _BRIEF + 1) & (found.size[1:] * found.size[:-1] < 0)
    lasting = np.ones(len(found), bool)  # not taken back within a few rows
    lasting[1:] &= ~back
    lasting[:-1] &= ~back
    period, is_wrap = _period(theta, found, lasting, motion)
    if period:
        turns = np.zeros(len(theta))
        np.add.at(turns, found.b[is_wrap], -np.rint(found.size[is_wrap] / period))
        theta, times = theta + np.cumsum(period * turns), int(is_wrap.sum())
    elif len(found) == 0 or lasting.any():
        period, theta, times = _many_wraps(theta, motion)
    if not period:
        return theta, []
    said = f"{role} jumps by {period:.6g} {'once' if times == 1 else f'{times} times'}: unwrapped"
    if motion == "rotary" and abs(period - 360) < 1e-6:
        theta = np.pi / 180 * theta
        stated = f"stated in {label}" if label else "without a unit"
        said += f", and converted from deg ({stated}, but a turn is 360)"
    return theta, [said + "."]


def _period(
    theta: np.ndarray, found: Jumps, lasting: np.ndarray, motion: str
) -> tuple[float, np.ndarray]:
    """Return the period of a register or of whole turns (0: none), and which jumps are wraps."""
    sizes, margin = np.abs(found.size), found.margin
    none = np.zeros(len(found), bool)
    if not lasting.any():
        return 0.0, none
    alike = [lasting & (np.abs(sizes - size) <= margin) for size in sizes[lasting]]
    is_wrap = max(alike, key=lambda fits: int(fits.sum()))
    period, usual = float(np.median(sizes[is_wrap])), float(np.median(margin[is_wrap]))
    if period < 20 * usual:
        return 0.0, none
    turns = [_TURN * n for n in range(1, _TURNS + 1)] + [360.0] if motion == "rotary" else []
    known = [*turns, *_counters(theta[np.isfinite(theta)])]
    nearest = min(known, key=lambda size: abs(size - period), default=0.0)
    if abs(nearest - period) <= 2 * found.resolution + usual / np.sqrt(is_wrap.sum()):
        return float(nearest), is_wrap
    spans = np.nanmax(theta) - np.nanmin(theta) <= 1.02 * period + float(margin[is_wrap].max())
    goes_on = found.steady[is_wrap].mean() > 0.6
    return (period, is_wrap) if spans and goes_on and is_wrap[lasting].all() else (0.0, none)


def _counters(values: np.ndarray) -> list[float]:
    """Return the spans of counters with the step of these values."""
    step = quantum(values) if values.size else 0.0
    return [2.0**bits * step for bits in _BITS if step]


def _many_wraps(theta: np.ndarray, motion: str) -> tuple[float, np.ndarray, int]:
    """Return the period of a position within it (0: none), it without wraps, and their number."""
    good = np.flatnonzero(np.isfinite(theta))
    values = theta[good]
    travel = float(np.ptp(values)) if values.size else 0.0
    tries = [period for period in _counters(values) if travel < period < 1.1 * travel]
    if motion == "rotary":
        tries = [_TURN * min(max(1, round(travel / _TURN)), _TURNS), 360.0, *tries]
    steps = np.abs(np.diff(values))
    for period in tries:
        is_wrap = steps > period / 2
        usual = steps[~is_wrap].max(initial=0.0)
        # beside larger steps a wrap looks like a fast motion
        clear = is_wrap.any() and travel <= 1.02 * period and usual <= _SMALL * period
        if clear and np.all(np.abs(steps[is_wrap] - period) <= 2 * usual + 0.01 * period):
            theta = theta.copy()
            theta[good] = np.unwrap(values, period=period)
            return period, theta, int(is_wrap.sum())
    return 0.0, theta, 0


# ---- jumps that are no wraps --------------------------------------------------------


def make_continuous(log: Stamped) -> None:
    """Leave out excursions and what stands still; begin a part where a position jumps else."""

    def unconfirmed(role: str) -> Jumps:
        found = _jumps(log, role)
        return found.only(~confirmed(log, role)[found.b])  # that no other signal shows

    for role in ("theta", "w"):
        if role in log.channels:
            _leave_out_excursions(log, role)
            _leave_out_stuck(log, role, unconfirmed(role))
    if "theta" not in log.channels:
        return
    found = unconfirmed("theta")
    at = [k for k in range(len(found)) if not log.new[found.a[k] + 1 : found.b[k] + 1].any()]
    if at:
        log.new[found.b[at]] = True
        size = f"{found.size[at[0]]:.4g} {si_unit('theta', log.motion)}"
        more = f" and {count(len(at) - 1, 'time')} more" if len(at) > 1 else ""
        log.say(
            f"theta jumps by {size} at {log.place(found.b[at[0]])}{more}, which is no motion: the "
            "parts are treated separately."
        )


def _leave_out_excursions(log: Stamped, role: str) -> None:
    """Leave out rows between a jump and the jump back: a few, or any that keep one value."""
    x = log.channels[role]
    found, bad = _jumps(log, role), np.zeros(len(x), bool)
    for i in range(len(found) - 1):
        there, back = found.size[i], found.size[i + 1]
        rows = slice(int(found.b[i]), int(found.a[i + 1]) + 1)
        returns = abs(there + back) <= 0.3 * abs(there) + 2 * found.margin[i : i + 2].sum()
        one = bool((x[rows] == x[rows.start]).all())
        brief = returns and rows.stop - rows.start <= _BRIEF
        if there * back < 0 and (brief or one and (returns or role == "theta")):
            bad[rows] = True
    leave_out(log, role, bad & ~over_loss(log, role) & ~confirmed(log, role), OFF)


# ---- motion that stands still by mistake --------------------------------------------


def _leave_out_stuck(log: Stamped, role: str, found: Jumps) -> None:
    """Leave out runs of one value that end or begin at a jump: a position that stops at once, a
    speed that loses its noise, or a channel that stands still with all others, was not read."""
    x = log.channels[role]
    bad, edges = np.zeros(len(x), bool), np.r_[0, np.flatnonzero(np.diff(x) != 0) + 1, len(x)]
    for before, after in zip(found.a, found.b, strict=True):
        start = edges[np.searchsorted(edges, before, side="right") - 1]
        stop = edges[np.searchsorted(edges, after, side="right")]
        for run, backward in ((slice(start, before + 1), True), (slice(after, stop), False)):
            starts = role == "w" and x[run.start] == 0  # a drive at rest may start within a row
            if not starts and run.stop - run.start >= _FEWEST:
                bad[run] |= _is_stuck(log, role, run, backward)
    if not bad.any():
        return
    if role == "w":  # a speed that keeps its last value now and then stands, whatever ends that
        kept = (x != 0) & (repeats(x) > _LONG)
        bad |= kept & _differ(x[~kept])
    first = int(bad.argmax())
    log.leave_out(
        role,
        bad,
        f"{role} stands at {log.value(role, first)} for {count(int(bad.sum()), 'row')} from "
        f"{log.place(first)} on and then jumps: these rows are left out.",
    )


def _is_stuck(log: Stamped, role: str, run: slice, backward: bool) -> bool:
    """Return whether the rows of one value before (``backward``) or after a jump were not read."""
    x = log.channels[role]
    beside = x[max(run.start - 4, 0) : run.start + 1]
    if not backward:
        beside = x[run.stop - 1 : run.stop + 4][::-1]
    steps = np.diff(beside[np.isfinite(beside)])
    if len(steps) > 1:  # the motion stops or sets in at once
        usual = abs(np.median(steps))
        if usual > 3 * np.abs(np.diff(steps)).max() + 1e-12 and abs(steps[-1]) > 0.5 * usual:
            return True
    others = (log.channels[other][run] for other in log.required)
    if all(bool((part == part[0]).all()) for part in others):
        return True
    noisy = _differ(np.r_[x[: run.start], x[run.stop :]])
    return role == "w" and run.stop - run.start >= _LONG and noisy


def _differ(x: np.ndarray) -> bool:
    """Return whether nearly every sample differs from the one before."""
    return len(x) > 1 and bool(np.mean(np.diff(x) == 0) < 0.05)
