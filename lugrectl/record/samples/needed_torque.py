"""Torques that were not read: registers at their end or that wrap, readings that stand still. Their
values alone do not show it; the motion does: by a rough balance it needs another torque than the
log says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.numeric import column_sizes, top_speed
from ...core.regression import TINY, Prior, robust, spread
from ...core.unit_names import si_unit
from ..signal_noise import quantum, repeats
from .clock import FEWEST, typical_step
from .rows import Stamped, bridged

_WIDTHS = (4, 6, 9, 14, 20, 30, 45, 70)  # samples, half-widths of the windows that are tried
_LONGEST = 0.15  # s, half-width of the widest window
_REST = 0.03  # of the top speed; below, friction is not known from the motion
_QUICK = 0.3  # of the top speed; above, a law is known that has been fitted to the motion
_SEEN = 10.0  # times as far as the usual row: beyond it, the fit extrapolates
_ROUNDS = 12  # of the robust fit
_ENOUGH = 64_000  # rows that choose the width
_LONG = 6  # equal samples in a row that may be a stuck reading
_AT_LIMIT = 2  # the same on the end of the channel's range
_MOST = 0.6  # of the rows: a torque that stands longer is held on purpose
_FAR = 10.0  # times the usual error of the balance, to call a torque untrue
_SHARE = 0.02  # the same as a share of the torque


# ---- the torque that the motion needs -----------------------------------------------


@dataclass(frozen=True, eq=False)
class Balance:
    """The balance ``u = J a + Fc sign(w) + Fv w + T0 + load(theta)``, averaged over windows."""

    torque: np.ndarray  # (N,) what the motion needs about each row, NaN where it is not known
    scale: float  # usual difference to the recorded torque
    moving: np.ndarray  # (N,) where the drive moves
    width: int  # half-width of the windows, rows
    parts: list[slice]
    error: np.ndarray  # (N,) usual difference: at rest, friction may be anything up to its level
    judged: np.ndarray  # (N,) such motion was seen, and not at low speed with another friction
    a: np.ndarray  # (N,) acceleration
    share: float  # of the torque that is left

    def missing(self, u: np.ndarray) -> np.ndarray:
        """Return what the motion needs beyond a torque (N,), averaged."""
        return self.torque - _over(self.parts, u, _kernel(self.width, 0))


def balance(log: Stamped, unknown: np.ndarray | None = None) -> Balance | None:
    """Fit the balance to the rows not ``unknown``; None if it explains less than half of u."""
    parts = [p for p in log.parts() if p.stop - p.start >= 4 * FEWEST]
    known = np.isfinite(log.channels["u"])
    if not parts or not known.any() or np.isfinite(log.motion_signal).sum() < FEWEST:
        return None
    skip = ~known if unknown is None else ~known | unknown
    longest = max(p.stop - p.start for p in parts)
    dt = typical_step(np.concatenate([np.diff(log.t[p]) for p in parts]))
    widths = [w for w in _WIDTHS if w * dt <= max(_LONGEST, _WIDTHS[0] * dt) and 6 * w < longest]
    some = [slice(p.start, min(p.stop, p.start + _ENOUGH)) for p in parts if p.start < _ENOUGH]
    best = None
    for chosen in [some] if some == parts else [some, parts]:
        tried = [fit for width in widths if (fit := _fit(log, skip, chosen, dt, width)) is not None]
        best = min(tried, key=lambda fit: fit.share, default=None)
        best = best if best is not None and best.share < 0.5 else None
        widths = widths if best is None else [best.width]
    return best


def _fit(
    log: Stamped, skip: np.ndarray, parts: list[slice], dt: float, width: int
) -> Balance | None:
    """Return the balance with windows of one width; None where the motion is too little."""

    def over(x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
        return _over(parts, x, kernel)

    motion = bridged(log.motion_signal, ~np.isfinite(log.motion_signal))
    is_position = "theta" in log.channels
    k0, k1, k2 = (_kernel(width, order) / dt**order for order in range(3))
    w, a = (over(motion, kernel) for kernel in ((k1, k2) if is_position else (k0, k1)))
    mean = over(bridged(log.channels["u"], skip), k0)
    unknown, speed = np.nan_to_num(over(skip.astype(float), k0)), np.abs(np.nan_to_num(w))
    known = np.isfinite(a) & np.isfinite(mean)
    top = top_speed(w[known]) if known.sum() >= 4 * FEWEST else 0.0
    if not top > 0:
        return None
    rest = (speed <= _REST * top).astype(float)
    sign = over(np.where(rest, 0.0, np.sign(np.nan_to_num(w))), k0)
    load = [np.sin(motion), np.cos(motion)] if log.motion == "rotary" else [motion - motion.mean()]
    x = np.column_stack([a, w, np.ones(len(w)), sign, *(load if is_position else [])])
    known &= np.isfinite(sign)
    moving = known & (np.nan_to_num(over(rest, k0)) < 0.02) & (np.abs(np.nan_to_num(sign)) > 0.98)
    used = np.flatnonzero(moving & (unknown < 0.02))[:: max(1, width // 3)]
    one_way = abs(np.sign(sign[used]).sum()) == len(used)
    if one_way:  # Coulomb friction is the constant
        x = np.delete(x, 3, axis=1)
    if len(used) < 3 * x.shape[1]:
        return None
    size, usual = column_sizes(x[used]), spread(mean[used] - np.median(mean[used]))
    least = 1e-12 * float(np.abs(mean[used]).max()) + TINY
    scale, weights, free = usual + least, None, Prior.free(len(size))
    for _ in range(_ROUNDS):  # as with two degrees of freedom
        close = scale / np.sqrt(2.0)
        fit = robust(x[used] / size, mean[used], free, close, weights=weights, turns=1)
        weights, scale = fit.w, spread(fit.r) * close + least
    p = fit.b / size
    # at most so much of the mean is of rows at rest
    level = 0.0 if one_way else abs(p[3])
    error = scale + level * np.nan_to_num(over(rest, np.abs(k0)), nan=1.0)
    judged = moving & (speed > _QUICK * top)
    judged[judged] &= _far(x[judged], x[used]) < _SEEN
    torque, share = np.where(known, x @ p, np.nan), scale / max(usual, TINY)
    return Balance(torque, scale, moving, width, parts, error, judged, a, share)


def _far(x: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return how far rows (n, k) are from those that were seen: 1 for the usual one of them."""
    size = column_sizes(seen)
    inverse = np.linalg.pinv((seen / size).T @ (seen / size), hermitian=True)
    return np.sum(x / size @ inverse * (x / size), axis=1) * len(seen) / x.shape[1]


def _kernel(width: int, order: int) -> np.ndarray:
    """Weights on samples -width..width for the average, the slope or the curvature of a signal."""
    s = np.arange(-width, width + 1) / (width + 1)
    powers = np.vander(s, 4, increasing=True)  # exact for parabolas
    want = np.zeros(4)
    want[order] = (1.0, 1.0, 2.0)[order] / (width + 1) ** order
    basis = powers * ((1 - s**2) ** 4)[:, None]
    return basis @ np.linalg.solve(powers.T @ basis, want)


def _over(parts: Sequence[slice], x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Return the windows about each sample; NaN where they reach beyond the ends of a part."""
    half = len(kernel) // 2
    means = np.full(len(x), np.nan)
    for part in parts:
        own = x[part]
        if len(own) > 2 * half:
            middle = own[len(own) // 2]
            inner = np.convolve(own - middle, kernel[::-1], "valid") + middle * kernel.sum()
            means[part.start + half : part.stop - half] = inner
    return means


# ---- readings that stand still ------------------------------------------------------


def _in_doubt(u: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows in runs of one value: on an end of the range, and in long ones elsewhere."""
    usual = float(np.median(lengths))  # of the run that the typical row lies in
    limit, ends = np.zeros(len(u), bool), (np.nanmin(u), np.nanmax(u))
    for end in ends:
        at_end = (u == end) & (lengths >= _AT_LIMIT)
        limit |= at_end & (at_end.sum() >= 5 * usual)  # a held torque has an extreme, too
    stuck = (lengths >= max(_LONG, 5 * usual)) & ~np.isin(u, ends)
    return limit, stuck & ((limit | stuck).mean() <= _MOST)


def _least(fit: Balance, missing: np.ndarray, unknown: np.ndarray) -> float:
    """The least missing torque that is no error of the rough balance."""
    away = fit.moving & np.isfinite(missing) & ~unknown
    if away.sum() < 30:
        return np.inf
    beside = np.nan_to_num(_over(fit.parts, unknown.astype(float), _kernel(fit.width, 0)), nan=1.0)
    clean = np.abs(missing)[away & (beside < 0.02)]
    usual = float(np.quantile(clean, 0.95)) if len(clean) > 30 else 0.0
    return max(_FAR * fit.scale, usual)


def leave_out_untrue_torque(log: Stamped) -> None:
    """Leave out torques that stand at one value while the motion needs another."""
    u = log.channels["u"]
    if not np.isfinite(u).any():
        return
    lengths = repeats(u)
    limit, stuck = _in_doubt(u, lengths)
    unknown = limit | stuck
    if not 0 < unknown.mean() <= _MOST:
        return
    # fitted with the rows in doubt where that leaves little of the torque, else without: rests and
    # coasts are in doubt, too, and without them it may rest on little
    large, fit = float(np.nanquantile(np.abs(u), 0.9)), balance(log)
    if fit is None or fit.scale >= _SHARE * large:
        fit = balance(log, unknown)
    if fit is None:
        return
    missing = fit.missing(np.nan_to_num(u))
    least = max(_least(fit, missing, unknown), _SHARE * large)
    # at the end of a register the motion needs more than it, in some rows; else more or less
    ends = (np.nanmin(u), -1.0), (np.nanmax(u), 1.0)
    groups = [(np.flatnonzero(u == x), side, 0.8) for x, side in ends if limit[u == x].any()]
    begins = np.flatnonzero(stuck & (np.diff(u, prepend=np.nan) != 0))
    groups += [(np.arange(a, a + lengths[a]), 0.0, 0.5) for a in begins if lengths[a] >= fit.width]
    for at, side, share in groups:
        judged = missing[at][fit.judged[at]]
        if len(judged) < 5:
            continue
        side = side or float(np.copysign(1.0, np.median(judged)))
        beyond = side * float(np.quantile(side * judged, share))
        if side * beyond > least:
            rows = np.isin(np.arange(len(u)), at)
            value, more = log.value("u", at[0]), f"{beyond:+.3g} {si_unit('u', log.motion)}"
            said = f"u stands at {value} {log.places(rows)}, while the motion needs {more} beyond"
            log.leave_out("u", rows, f"{said} it: left out.")


# ---- registers that wrap ------------------------------------------------------------


def unwrap_torque(log: Stamped) -> None:
    """Add the multiples of a register's span that bring u to what the motion needs."""
    u = log.channels["u"]
    span = _span(u[np.isfinite(u)])
    if not span or not (np.abs(np.diff(u)) > span / 2).any():
        return
    fit = balance(log)
    if fit is None:
        return
    turns = np.nan_to_num(np.rint((fit.torque - u) / span))
    moved, changed = u + span * turns, turns != 0
    left, before = (
        np.nansum(np.abs(fit.missing(np.nan_to_num(x))) / fit.error) for x in (moved, u)
    )
    if 0 < changed.mean() <= 0.5 and left <= before:
        log.say(
            f"u wraps by {span:.6g} {si_unit('u', log.motion)} {log.places(changed)} "
            f"({log.value('u', int(changed.argmax()))}), as the motion shows: unwrapped."
        )
        log.channels["u"] = moved


def _span(values: np.ndarray) -> float:
    """Return the span of the register of a power of two steps that values fill; 0 for none."""
    step = quantum(values) if len(values) else 0.0
    if not step:
        return 0.0
    span = float(np.ptp(values)) + step
    power = step * 2.0 ** np.rint(np.log2(span / step))
    return float(power) if -1e-6 * span < power - span < 0.02 * span else 0.0
