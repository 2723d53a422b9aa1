"""Torques that were not read: registers at their end or that wrap, readings that stand still. Their
values alone do not show it; the motion does: by a rough balance it needs another torque than the
log says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.numeric import column_sizes, top_speed
from ...core.regression import spread
from ...core.unit_names import si_unit
from ..signal_noise import quantum, repeats
from .clock import FEWEST, typical_step
from .rows import Stamped, bridged, count

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
_SEGMENTS = 4000  # between jumps of a register; with more, its jumps are noise


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
    best = _best(log, skip, some, widths)
    if some == parts:
        return best
    return _best(log, skip, parts, widths if best is None else [best.width])


def _best(
    log: Stamped, skip: np.ndarray, parts: list[slice], widths: Sequence[int]
) -> Balance | None:
    """Return the balance that explains most of the torque; None if it is less than half."""
    tried = [fit for width in widths if (fit := _fit(log, skip, parts, width)) is not None]
    best = min(tried, key=lambda fit: fit.share, default=None)
    return best if best is not None and best.share < 0.5 else None


def _fit(log: Stamped, skip: np.ndarray, parts: list[slice], width: int) -> Balance | None:
    """Return the balance with windows of one width; None where the motion is too little."""

    def over(x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
        return _over(parts, x, kernel)

    motion = bridged(log.motion_signal, ~np.isfinite(log.motion_signal))
    dt = typical_step(np.concatenate([np.diff(log.t[p]) for p in parts]))
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
    p, scale = _robust(x[used], mean[used])
    usual = spread(mean[used] - np.median(mean[used]))
    # at most so much of the mean is of rows at rest
    level = 0.0 if one_way else abs(p[3])
    error = scale + level * np.nan_to_num(over(rest, np.abs(k0)), nan=1.0)
    judged = moving & (speed > _QUICK * top)
    judged[judged] &= _far(x[judged], x[used]) < _SEEN
    torque, share = np.where(known, x @ p, np.nan), scale / max(usual, 1e-300)
    return Balance(torque, scale, moving, width, parts, error, judged, a, share)


def _far(x: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return how far rows (n, k) are from those that were seen: 1 for the usual one of them."""
    size = column_sizes(seen)
    inverse = np.linalg.pinv((seen / size).T @ (seen / size), hermitian=True)
    return np.sum(x / size @ inverse * (x / size), axis=1) * len(seen) / x.shape[1]


def _robust(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit with weights of a Student density (nu = 2): coefficients and usual error."""
    size = column_sizes(x)
    weight, p, scale = np.ones(len(y)), np.zeros(x.shape[1]), 0.0
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)
        p = np.linalg.lstsq(x / size * root[:, None], y * root, rcond=1e-9)[0] / size
        r = y - x @ p
        scale = spread(r) + 1e-12 * float(np.abs(y).max())
        if not scale > 0:
            break
        weight = 3.0 / (2.0 + (r / scale) ** 2)
    return p, scale


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
    u, unit = log.channels["u"], si_unit("u", log.motion)
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
    for value, beyond in ((np.nanmin(u), -missing), (np.nanmax(u), missing)):
        beyond = beyond[limit & (u == value) & fit.judged]
        if len(beyond) >= 5 and np.quantile(beyond, 0.7) > least:
            at = log.channels["u"] == value
            log.leave_out(
                "u",
                at,
                f"u stays at the end of its register, {value:.6g} {unit}, {log.places(at)}, "
                f"while the motion needs up to {np.max(beyond):.3g} {unit} more: left out.",
            )
    for a in np.flatnonzero(stuck & (np.diff(u, prepend=np.nan) != 0)).tolist():
        n = int(lengths[a])
        judged = missing[a : a + n][fit.judged[a : a + n]]
        if n >= fit.width and len(judged) >= 5 and abs(np.median(judged)) > least:
            log.leave_out(
                "u",
                slice(a, a + n),
                f"u stands at {log.value('u', a)} for {count(n, 'row')} from {log.place(a)} on "
                f"while the motion needs {np.median(judged):+.3g} {unit} beyond it: left out.",
            )


# ---- registers that wrap ------------------------------------------------------------


def unwrap_torque(log: Stamped) -> None:
    """Add the multiples of a register's span that bring u to what the motion needs."""
    u = log.channels["u"]
    values, span = np.nan_to_num(u), _span(u[np.isfinite(u)])
    steps = np.abs(np.diff(values))
    if not span or not (steps > span / 2).any():
        return
    # a jump of the torque that wraps may come out as a smaller one
    edges = np.flatnonzero(steps > max(span / 16, 10 * np.median(steps))) + 1
    starts = np.r_[0, edges]
    fit = balance(log) if 1 < len(starts) <= _SEGMENTS else None
    if fit is None:
        return
    missing = np.split((fit.torque - values) / span, edges)
    middle = np.array(
        [np.median(x[np.isfinite(x)]) if np.isfinite(x).any() else np.nan for x in missing]
    )
    known = np.isfinite(middle)
    jumps = np.r_[0.0, np.cumsum(np.rint((values[edges - 1] - values[edges]) / span))]
    near = np.interp(starts, starts[known], (np.rint(middle) - jumps)[known])
    turns = np.where(
        known, np.rint(middle), jumps + np.rint(near)
    )  # beyond the windows: the smallest jump
    lengths = np.diff(np.r_[starts, len(u)])
    turns -= turns[int(np.argmax(lengths))]
    moved = values + span * np.repeat(turns, lengths)
    changed = moved != values
    left, before = (np.nansum(np.abs(fit.missing(x)) / fit.error) for x in (moved, values))
    if not 0 < changed.mean() <= 0.5 or left > before:
        return
    log.say(
        f"u wraps by {span:.6g} {si_unit('u', log.motion)} {log.places(changed)} "
        f"({log.value('u', int(changed.argmax()))}), as the motion shows: unwrapped."
    )
    log.channels["u"] = np.where(np.isfinite(u), moved, np.nan)


def _span(values: np.ndarray) -> float:
    """Return the span of the register of a power of two steps that values fill; 0 for none."""
    step = quantum(values) if len(values) else 0.0
    if not step:
        return 0.0
    span = float(np.ptp(values)) + step
    power = step * 2.0 ** np.rint(np.log2(span / step))
    return float(power) if -1e-6 * span < power - span < 0.02 * span else 0.0
