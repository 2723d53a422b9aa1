"""The torque that the motion needs: a rough balance that shows where a torque was not read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...core.numeric import column_sizes, top_speed
from ...core.regression import spread
from .clock import FEWEST, typical_step
from .rows import Stamped, bridged

_WIDTHS = (4, 6, 9, 14, 20, 30, 45, 70)  # samples, half-widths of the windows that are tried
_LONGEST = 0.15  # s, half-width of the widest window
_REST = 0.03  # of the top speed; below, friction is not known from the motion
_QUICK = 0.3  # of the top speed; above, a law is known that has been fitted to the motion
_SEEN = 10.0  # times as far as the usual row: beyond it, the fit extrapolates
_ROUNDS = 12  # of the robust fit
_ENOUGH = 64_000  # rows that choose the width: of a longer log, stretches all along it
_STRETCH = 16 * _WIDTHS[-1]  # rows


@dataclass(frozen=True, eq=False)
class Needed:
    """The balance ``u = J a + Fc sign(w) + Fv w + T0 + load(theta)``, averaged over windows."""

    torque: np.ndarray  # (N,) what the motion needs about each row, NaN where it is not known
    scale: float  # usual difference to the recorded torque
    moving: np.ndarray  # (N,) where the drive moves
    width: int  # half-width of the windows, rows
    parts: tuple[slice, ...]
    error: np.ndarray  # (N,) usual difference: at rest, friction may be anything up to its level
    judged: np.ndarray  # (N,) such motion was seen, and not at low speed with another friction
    a: np.ndarray  # (N,) acceleration
    share: float  # of the torque that is left

    def averaged(self, u: np.ndarray) -> np.ndarray:
        """Return a torque (N,) averaged as the balance is; NaN at the ends of the parts."""
        return _over(self.parts, u, _kernel(self.width, 0))

    def missing(self, u: np.ndarray) -> np.ndarray:
        """Return what the motion needs beyond a torque (N,), averaged."""
        return self.torque - self.averaged(u)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Torque and motion (N,) in parts of even time; ``skip`` marks rows where u is unknown."""

    parts: tuple[slice, ...]
    u: np.ndarray
    motion: np.ndarray
    skip: np.ndarray
    dt: float
    is_position: bool
    is_rotary: bool

    def thinned(self) -> _Rows:
        """Return stretches of about as many rows as are enough, all along a long log."""
        every = sum(p.stop - p.start for p in self.parts) / _ENOUGH
        if every <= 1.0:
            return self
        step = round(every * _STRETCH)
        starts = [(a, p.stop) for p in self.parts for a in range(p.start, p.stop, step)]
        cut = [np.arange(a, min(a + _STRETCH, stop)) for a, stop in starts]
        cut = [rows for rows in cut if len(rows) >= 4 * FEWEST]
        ends = np.cumsum([0, *map(len, cut)]).tolist()
        at = np.concatenate([np.zeros(0, dtype=int), *cut])
        some = {k: getattr(self, k)[at] for k in ("u", "motion", "skip")}
        return replace(self, parts=tuple(map(slice, ends, ends[1:])), **some)


def needed(log: Stamped, unknown: np.ndarray | None = None) -> Needed | None:
    """Fit the balance to the rows of a log but those where u is ``unknown``; None if the motion
    explains less than half of the torque."""
    u, motion = log.channels.get("u"), log.motion_signal
    parts = tuple(p for p in log.parts() if p.stop - p.start >= 4 * FEWEST)
    if u is None or motion is None or not parts or not np.isfinite(u).any():
        return None
    if np.isfinite(motion).sum() < FEWEST:
        return None
    skip = ~np.isfinite(u) if unknown is None else ~np.isfinite(u) | unknown
    motion = bridged(motion, ~np.isfinite(motion))
    dt = typical_step(np.concatenate([np.diff(log.t[p]) for p in parts]))
    is_position, is_rotary = "theta" in log.channels, log.motion == "rotary"
    rows = _Rows(parts, bridged(u, skip), motion, skip, dt, is_position, is_rotary)
    longest = max(p.stop - p.start for p in parts)
    widths = [w for w in _WIDTHS if w * dt <= max(_LONGEST, _WIDTHS[0] * dt) and 6 * w < longest]
    some = rows.thinned()
    best = None if some is rows else _best(some, widths)
    return _best(rows, widths if best is None else [best.width])


def _best(rows: _Rows, widths: Sequence[int]) -> Needed | None:
    """Return the balance that explains most of the torque; None if it is less than half."""
    tried = [fit for width in widths if (fit := _fit(rows, width)) is not None]
    best = min(tried, key=lambda fit: fit.share, default=None)
    return best if best is not None and best.share < 0.5 else None


def _fit(rows: _Rows, width: int) -> Needed | None:
    """Return the balance with windows of one width; None where the motion is too little."""

    def over(x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
        return _over(rows.parts, x, kernel)

    k0, k1, k2 = (_kernel(width, order) for order in range(3))
    first, second = (k1 / rows.dt, k2 / rows.dt**2) if rows.is_position else (k0, k1 / rows.dt)
    w, a = over(rows.motion, first), over(rows.motion, second)
    mean, unknown = over(rows.u, k0), np.nan_to_num(over(rows.skip.astype(float), k0))
    known = np.isfinite(a) & np.isfinite(mean)
    top = top_speed(w[known]) if known.sum() >= 4 * FEWEST else 0.0
    if not top > 0:
        return None
    speed = np.abs(np.nan_to_num(w))
    rest = (speed <= _REST * top).astype(float)
    sign = over(np.where(rest, 0.0, np.sign(np.nan_to_num(w))), k0)
    x, load = rows.motion, []
    if rows.is_position:
        load = [np.sin(x), np.cos(x)] if rows.is_rotary else [x - x.mean()]
    x = np.column_stack([a, w, np.ones(len(w)), sign, *load])
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
    level = 0.0 if one_way else abs(p[3])
    # at most so much of the mean is of rows at rest
    error = scale + level * np.nan_to_num(over(rest, np.abs(k0)), nan=1.0)
    judged = moving & (speed > _QUICK * top)
    judged[judged] &= _far(x[judged], x[used]) < _SEEN
    torque, share = np.where(known, x @ p, np.nan), scale / max(usual, 1e-300)
    return Needed(torque, scale, moving, width, rows.parts, error, judged, a, share)


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
