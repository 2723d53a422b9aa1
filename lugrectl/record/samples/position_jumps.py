"""Positions without jumps: wrapped angles and counters unwrapped, pasted runs cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bad_samples import OFF, confirmed, leave_out, over_loss
from .clock import usual_step
from .frozen_motion import leave_out_stuck
from .outliers import distances, limits, quantum, resolution
from .rows import Stamped, count

_TURNS = 16  # most turns after which a counter wraps (57 turns would look like 360 deg)
_TURN = 2 * np.pi
_SMALL = 1 / 3  # of the period, largest step beside which a wrap (above two thirds) is plain
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

    def only(self, which: np.ndarray) -> Jumps:
        """Some of them."""
        a, b, size = self.a[which], self.b[which], self.size[which]
        return Jumps(a, b, size, self.steady[which], self.pace[which], self.resolution)

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
    """The jumps of a channel; searched for again only where it or its stamps have changed."""
    t, x = log.t, log.channels[role]
    known = log.known.get(role)
    if known is None or known[0] is not t or known[1] is not x:
        known = log.known[role] = (t, x, jumps(t, x))
    return known[2]


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
    found: Jumps | None = None,
) -> tuple[np.ndarray, list[str]]:
    """Return a position without wraps, and a sentence if there were any.

    A position wraps by whole turns, by a power of two of its own steps, or by any period where
    all its jumps are of one size and span its whole range while the motion goes on. Jumps by 360
    mean that degrees were read as radians: the angle is then converted, too. NaN is skipped.
    ``found`` are the jumps of the position where they are known already.
    """
    if found is None:
        found = jumps(np.arange(len(theta)) if t is None else t, theta)
    lasting = _lasting(found)
    period, is_wrap = _period(theta, found, lasting, motion)
    if not period:
        either = len(found) == 0 or bool(lasting.any())
        return _many_wraps(role, theta, label, motion) if either else (theta, [])
    factor = np.pi / 180 if motion == "rotary" and abs(period - 360) < 1e-6 else 1.0
    moved = np.zeros(len(theta))
    np.add.at(moved, found.b[is_wrap], -period * np.rint(found.size[is_wrap] / period))
    said = f"{role} jumps by {period:.6g} {_times(int(is_wrap.sum()))}: unwrapped"
    if factor != 1.0:
        said += _converted(label)
    return factor * (theta + np.cumsum(moved)), [said + "."]


def _lasting(found: Jumps) -> np.ndarray:
    """Which jumps are not taken back within a few rows."""
    made = np.ones(len(found), bool)
    for i in range(len(found) - 1):
        near = found.b[i + 1] - found.a[i] <= _BRIEF + 1
        if near and found.size[i] * found.size[i + 1] < 0:
            made[i : i + 2] = False
    return made


def _converted(label: str | None) -> str:
    stated = f"stated in {label}" if label else "without a unit"
    return f", and converted from deg ({stated}, but a turn is 360)"


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _many_wraps(
    role: str, theta: np.ndarray, label: str | None, motion: str
) -> tuple[np.ndarray, list[str]]:
    """Wraps of a position that stays within its period, however often it wraps."""
    good = np.flatnonzero(np.isfinite(theta))
    values = theta[good]
    travel = float(np.ptp(values)) if values.size else 0.0
    periods = [2.0**bits * quantum(values) for bits in _BITS] if values.size else []
    tries = [(period, 1.0) for period in periods if travel < period < 1.1 * travel]
    if motion == "rotary":
        whole = _TURN * min(max(1, round(travel / _TURN)), _TURNS)
        tries = [(whole, 1.0), (360.0, np.pi / 180), *tries]
    for period, factor in tries:
        found = _whole_turns(values, period)
        if not found.any():
            continue
        result = theta.copy()
        result[good] = factor * np.unwrap(values, period=period)
        said = f"{role} jumps by {period:.6g} {_times(int(found.sum()))}: unwrapped"
        if factor != 1.0:
            said += _converted(label)
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
    if usual > _SMALL * period:  # a wrap looks like a fast motion
        return np.zeros(0, bool)
    return found if np.all(after <= 2 * usual + 0.01 * period) else np.zeros(0, bool)


def _period(
    theta: np.ndarray, found: Jumps, lasting: np.ndarray, motion: str
) -> tuple[float, np.ndarray]:
    """The period of a register or of whole turns, and which jumps are its wraps; 0 for none."""
    sizes, margin = np.abs(found.size), found.margin
    none = np.zeros(len(found), bool)
    if not lasting.any():
        return 0.0, none
    alike = [lasting & (np.abs(sizes - size) <= margin) for size in sizes[lasting]]
    is_wrap = max(alike, key=lambda fits: int(fits.sum()))
    period = float(np.median(sizes[is_wrap]))
    error = 2 * found.resolution + float(np.median(margin[is_wrap])) / np.sqrt(is_wrap.sum())
    if period < 20 * float(np.median(margin[is_wrap])):
        return 0.0, none
    known = _known(quantum(theta[np.isfinite(theta)]), motion)
    nearest = min(known, key=lambda size: abs(size - period), default=0.0)
    if abs(nearest - period) <= error:
        return float(nearest), is_wrap
    spans = np.nanmax(theta) - np.nanmin(theta) <= 1.02 * period + float(margin[is_wrap].max())
    goes_on = found.steady[is_wrap].mean() > 0.6
    return (period, is_wrap) if spans and goes_on and is_wrap[lasting].all() else (0.0, none)


def _known(step: float, motion: str) -> list[float]:
    """Whole turns, and the spans of counters whose step is known."""
    turns = [_TURN * n for n in range(1, _TURNS + 1)] + [360.0] if motion == "rotary" else []
    return turns + [2.0**bits * step for bits in _BITS if step]


# ---- jumps that are no wraps --------------------------------------------------------


def unwrap_positions(log: Stamped) -> None:
    """Unwrap the positions of a log."""
    for role in ("theta", "theta_load"):
        if role in log.channels:
            x, label = log.channels[role], log.labels.get(role)
            log.channels[role], said = unwrapped(
                role, x, label, log.t, log.motion, _jumps(log, role)
            )
            log.say(*said)


def make_continuous(log: Stamped) -> None:
    """Leave out what jumps away and back or stands still by mistake, and begin a new part where a
    position jumps for another reason."""
    for role in ("theta", "w"):
        if role in log.channels:
            _leave_out_excursions(log, role)
            found = _jumps(log, role)
            found = found.only(~confirmed(log, role)[found.b])
            leave_out_stuck(log, role, found.a, found.b)
    if "theta" in log.channels:
        found = _jumps(log, "theta")
        _cut(log, found.only(~confirmed(log, "theta")[found.b]))


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
