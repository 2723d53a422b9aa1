"""Positions without jumps: wrapped angles and counters unwrapped, pasted runs cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bad_samples import OFF, leave_out
from .clock import usual_step
from .outliers import distances, limits, resolution
from .stamped import Stamped, count
from .stuck import leave_out_stuck

_TURNS = 16  # most turns after which a counter wraps (57 turns would look like 360 deg)
_TURN = 2 * np.pi
_BRIEF = 4  # rows that may be off together
_BITS = (8, 10, 12, 14, 15, 16, 18, 20, 24, 31, 32)  # of counters


@dataclass(frozen=True, eq=False)
class Jumps:
    """Steps of a position that are no motion: between good row ``a`` and good row ``b``.

    ``size`` is what the step has beyond the motion around it; ``steady`` is whether the speed is
    the same on both sides, and not 0; ``pace`` is that speed, per row.
    """

    a: np.ndarray
    b: np.ndarray
    size: np.ndarray
    steady: np.ndarray
    pace: np.ndarray
    resolution: float

    def __len__(self) -> int:
        return len(self.a)

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
    limit = limits("theta", speed) + 6 * resolution(values) + 3 * np.quantile(far, 0.97)
    at = np.flatnonzero(far > limit)
    calm = speed.copy()
    calm[at] = np.nan
    before, after = _medians(calm, at)
    usual = np.nan_to_num(np.where(np.isfinite(before), before, after))
    usual = np.where(np.isfinite(after) & np.isfinite(before), (before + after) / 2, usual)
    quiet = resolution(values)
    steady = np.abs(before - after) <= 0.3 * np.abs(usual) + quiet
    steady &= np.abs(usual) > max(0.5 * quiet, 1e-9 * np.ptp(values))
    size = np.diff(values)[at] - usual * elapsed[at]
    return Jumps(good[at], good[at + 1], size, steady, np.abs(usual), quiet)


def _medians(x: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The medians of up to four values before and after each place; nan without any."""
    sides = []
    for side in (np.arange(-4, 0), np.arange(1, 5)):
        where = at[:, None] + side
        values = np.where((where >= 0) & (where < len(x)), x[where.clip(0, len(x) - 1)], np.nan)
        some = np.isfinite(values).any(1)
        found = np.full(len(at), np.nan)
        found[some] = np.nanmedian(values[some], axis=1)
        sides.append(found)
    return sides[0], sides[1]


# ---- wrapped positions --------------------------------------------------------------


def unwrapped(
    role: str,
    theta: np.ndarray,
    label: str | None = None,
    t: np.ndarray | None = None,
    motion: str = "rotary",
) -> tuple[np.ndarray, list[str]]:
    """Return a position without wraps, and a sentence if there were any.

    A position wraps by whole turns, by a power of two of its own steps, or by any period where
    all its jumps are of one size and span its whole range while the motion goes on. Jumps by 360
    mean that degrees were read as radians: the angle is then converted, too. NaN is skipped.
    """
    if motion == "rotary":
        made, said = _turns(role, theta, label)
        if said:
            return made, said
    found = jumps(np.arange(len(theta)) if t is None else t, theta)
    period, is_wrap = _period(theta, found, motion)
    if not period:
        return theta, []
    moved = np.zeros(len(theta))
    np.add.at(moved, found.b[is_wrap], -period * np.rint(found.size[is_wrap] / period))
    said = f"{role} jumps by {period:.6g} {_times(int(is_wrap.sum()))}: unwrapped."
    return theta + np.cumsum(moved), [said]


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _turns(role: str, theta: np.ndarray, label: str | None) -> tuple[np.ndarray, list[str]]:
    """Wraps by whole turns of an angle that stays within them."""
    good = np.flatnonzero(np.isfinite(theta))
    values = theta[good]
    travel = float(np.ptp(values)) if values.size else 0.0
    for turn, most, factor in ((_TURN, _TURNS, 1.0), (360.0, 1, np.pi / 180)):
        period = turn * min(max(1, round(travel / turn)), most)
        found = _whole_turns(values, period)
        if not found.any():
            continue
        result = theta.copy()
        result[good] = factor * np.unwrap(values, period=period)
        said = f"{role} jumps by {period:.4g} {_times(int(found.sum()))}: unwrapped"
        if factor != 1.0:
            stated = f"stated in {label}" if label else "without a unit"
            said += f", and converted from deg ({stated}, but a turn is 360)"
        return result, [said + "."]
    return theta, []


def _whole_turns(values: np.ndarray, period: float) -> np.ndarray:
    """Return where values wrap by the period; nowhere if that does not explain the jumps."""
    steps = np.diff(values)
    found = np.abs(steps) > period / 2
    if not found.any() or np.ptp(values) > 1.02 * period:
        return np.zeros(0, bool)
    after = np.abs(np.abs(steps[found]) - period)
    usual = np.abs(steps[~found]).max(initial=0.0)
    return found if np.all(after <= 2 * usual + 0.01 * period) else np.zeros(0, bool)


def _period(theta: np.ndarray, found: Jumps, motion: str) -> tuple[float, np.ndarray]:
    """The period of a register or of whole turns, and which jumps are its wraps; 0 for none."""
    sizes, margin = np.abs(found.size), found.margin
    known = [_TURN * n for n in range(1, _TURNS + 1)] if motion == "rotary" else []
    known += [2.0**bits * found.resolution for bits in _BITS] if found.resolution else []
    best, is_wrap = 0.0, np.zeros(len(found), bool)
    for period in known:
        close = margin + 1e-4 * period
        fits = (np.abs(sizes - period) <= close) & (period > 20 * margin)
        if fits.sum() > is_wrap.sum():
            best, is_wrap = float(period), fits
    if not best and len(found):
        period = float(np.median(sizes))
        fits = np.abs(sizes - period) <= margin
        spans = np.nanmax(theta) - np.nanmin(theta) <= 1.02 * period + margin.max()
        stays = np.all(found.a[1:] - found.b[:-1] >= 3)
        if spans and stays and fits.all() and found.steady.all() and period > 20 * margin.max():
            best, is_wrap = period, fits
    return best, is_wrap


# ---- jumps that are no wraps --------------------------------------------------------


def make_continuous(log: Stamped) -> None:
    """Unwrap positions, leave out what jumps away and back or stands still by mistake, and begin
    a new part where a position jumps for another reason."""
    for role in ("theta", "theta_load"):
        if role in log.channels:
            x, label = log.channels[role], log.labels.get(role)
            log.channels[role], said = unwrapped(role, x, label, log.t, log.motion)
            log.say(*said)
    for role in ("theta", "w"):
        if role in log.channels:
            _leave_out_excursions(log, role)
            found = jumps(log.t, log.channels[role])
            if len(found):
                leave_out_stuck(log, role, found.a, found.b)
    if "theta" in log.channels:
        _cut(log, jumps(log.t, log.channels["theta"]))


def _leave_out_excursions(log: Stamped, role: str) -> None:
    """Leave out rows between a jump and the jump back: a few, or any that keep one value."""
    x = log.channels[role]
    found, bad = jumps(log.t, x), np.zeros(len(x), bool)
    for i in range(len(found) - 1):
        there, back = found.size[i], found.size[i + 1]
        rows = slice(int(found.b[i]), int(found.a[i + 1]) + 1)
        returns = abs(there + back) <= 0.3 * abs(there) + 2 * found.margin[i : i + 2].sum()
        one = bool((x[rows] == x[rows.start]).all())
        if there * back < 0 and (one or returns and rows.stop - rows.start <= _BRIEF):
            bad[rows] = True
    leave_out(log, role, bad, OFF)


def _cut(log: Stamped, found: Jumps) -> None:
    """Begin a new part after each jump."""
    fresh = [k for k in range(len(found)) if not log.new[found.a[k] + 1 : found.b[k] + 1].any()]
    if not fresh:
        return
    log.new[found.b[fresh]] = True
    first = fresh[0]
    unit = "rad" if log.motion == "rotary" else "m"
    where = f"by {found.size[first]:.4g} {unit} at {log.place(found.b[first])}"
    more = f" and {count(len(fresh) - 1, 'time')} more" if len(fresh) > 1 else ""
    log.say(f"theta jumps {where}{more}, which is no motion: the parts are treated separately.")
