"""The torque that the motion needs: a rough balance that shows where a torque was not read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.numeric import top_speed
from .clock import FEWEST, typical_step
from .outliers import bridged
from .rows import Stamped

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
    """The balance ``u = J a + Fc sign(w) + Fv w + T0 + load(theta)``, averaged over windows.

    ``torque`` (N,) is what the motion needs about each row, NaN where it is not known; ``scale``
    is the usual difference to the recorded one; ``moving`` marks the rows where the drive moves.
    ``width`` is the half-width of the windows in rows. ``error`` (N,) is the usual difference about
    each row: where the drive rests, friction may be anything up to its level. ``judged`` marks the
    rows that the fit may judge: it has seen such motion, and not at low speed, where friction may
    be another. ``a`` (N,) is the acceleration.
    """

    torque: np.ndarray
    scale: float
    moving: np.ndarray
    width: int
    parts: tuple[slice, ...]
    error: np.ndarray
    judged: np.ndarray
    a: np.ndarray

    @property
    def kernel(self) -> np.ndarray:
        """The weights of the average, on rows about each row."""
        return _kernel(self.width, 0)

    def averaged(self, u: np.ndarray) -> np.ndarray:
        """A torque (N,) averaged as the balance is; NaN at the ends of the parts."""
        made = np.full(len(u), np.nan)
        for part in self.parts:
            made[part] = _over(u[part], self.kernel)
        return made

    def missing(self, u: np.ndarray) -> np.ndarray:
        """What the motion needs beyond a torque (N,), averaged."""
        return self.torque - self.averaged(u)


def needed(log: Stamped, unknown: np.ndarray | None = None) -> Needed | None:
    """Fit the balance to the rows of a log, but for those where u is ``unknown``.

    None if the motion explains less than half of the torque.
    """
    u, x, w = (log.channels.get(role) for role in ("u", "theta", "w"))
    parts = tuple(p for p in log.parts() if p.stop - p.start >= 4 * FEWEST)
    if u is None or not parts or not np.isfinite(u).any():
        return None
    skip = ~np.isfinite(u) if unknown is None else ~np.isfinite(u) | unknown
    torque = bridged(u, skip)
    motion = x if x is not None else w
    if motion is None or np.isfinite(motion).sum() < FEWEST:
        return None
    motion = bridged(motion, ~np.isfinite(motion))
    steps = np.concatenate([np.diff(log.t[p]) for p in parts])
    dt, longest = typical_step(steps), max(p.stop - p.start for p in parts)
    widths = [w for w in _WIDTHS if w * dt <= max(_LONGEST, _WIDTHS[0] * dt) and 6 * w < longest]
    kind = dt, x is not None, log.motion == "rotary"
    few, rows = _stretches(parts)
    if few != parts:
        found = _best(few, torque[rows], motion[rows], skip[rows], widths, *kind)
        widths = widths if found is None else [found.width]
    return _best(parts, torque, motion, skip, widths, *kind)


def _stretches(parts: tuple[slice, ...]) -> tuple[tuple[slice, ...], np.ndarray]:
    """Stretches of about as many rows as are enough, one behind the other, and their rows."""
    every = max(1.0, sum(p.stop - p.start for p in parts) / _ENOUGH)
    if every == 1.0:
        return parts, np.zeros(0, dtype=int)
    step = round(every * _STRETCH)
    cut = [range(a, min(a + _STRETCH, p.stop)) for p in parts for a in range(p.start, p.stop, step)]
    cut = [c for c in cut if len(c) >= 4 * FEWEST]
    ends = np.cumsum([0, *map(len, cut)]).tolist()
    return tuple(map(slice, ends, ends[1:])), np.concatenate([np.zeros(0, dtype=int), *cut])


def _best(
    parts: Sequence[slice],
    u: np.ndarray,
    motion: np.ndarray,
    skip: np.ndarray,
    widths: Sequence[int],
    *kind: Any,
) -> Needed | None:
    """The balance that explains most of the torque; None if it is less than half."""
    tried = [_fit(parts, u, motion, skip, width, *kind) for width in widths]
    share, best = min(filter(None, tried), key=lambda pair: pair[0], default=(1.0, None))
    return best if share < 0.5 else None


def _fit(
    parts: Sequence[slice],
    u: np.ndarray,
    motion: np.ndarray,
    skip: np.ndarray,
    width: int,
    dt: float,
    position: bool,
    rotary: bool,
) -> tuple[float, Needed] | None:
    """The balance with windows of one width, and the share of torque that it leaves."""
    n = len(u)
    a, w, mean, near = (np.full(n, np.nan) for _ in range(4))
    k0, k1, k2 = (_kernel(width, order) for order in range(3))
    first, second = (k1 / dt, k2 / dt**2) if position else (k0, k1 / dt)
    for p in parts:
        w[p], a[p] = _over(motion[p], first), _over(motion[p], second)
        mean[p], near[p] = _over(u[p], k0), _over(skip[p].astype(float), k0)
    known = np.isfinite(a) & np.isfinite(mean)
    if known.sum() < 4 * FEWEST:
        return None
    top = top_speed(w[known])
    if not top > 0:
        return None
    rest = np.abs(np.nan_to_num(w)) <= _REST * top
    sign, still = np.full(n, np.nan), np.full(n, np.nan)
    for p in parts:
        sign[p] = _over(np.where(rest[p], 0.0, np.sign(np.nan_to_num(w[p]))), k0)
        still[p] = _over(rest[p].astype(float), k0)
    columns = [a, w, np.ones(n), sign]
    if position:
        columns += [np.sin(motion), np.cos(motion)] if rotary else [motion - motion.mean()]
    x = np.column_stack(columns)
    known &= np.isfinite(sign)
    moving = known & (np.nan_to_num(still) < 0.02) & (np.abs(np.nan_to_num(sign)) > 0.98)
    used = np.flatnonzero(moving & (np.nan_to_num(near) < 0.02))[:: max(1, width // 3)]
    if abs(np.sign(sign[used]).sum()) == len(used):  # one way: Coulomb friction is the constant
        x = np.delete(x, 3, axis=1)
    if len(used) < 3 * x.shape[1]:
        return None
    p, scale = _robust(x[used], mean[used])
    usual = 1.4826 * float(np.median(np.abs(mean[used] - np.median(mean[used]))))
    share = scale / max(usual, 1e-300)
    level = abs(p[3]) if x.shape[1] == len(columns) else 0.0
    error = np.full(n, scale + level)
    for part in parts:  # at most so much of the mean is of rows at rest
        error[part] = scale + level * np.nan_to_num(
            _over(rest[part].astype(float), np.abs(k0)), nan=1.0
        )
    torque = np.where(known, x @ p, np.nan)
    judged = moving & (np.abs(np.nan_to_num(w)) > _QUICK * top)
    judged[judged] &= _far(x[judged], x[used]) < _SEEN
    return share, Needed(torque, scale, moving, width, tuple(parts), error, judged, a)


def _far(x: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """How far rows (n, k) are from those that were seen: 1 for the usual one of them."""
    size = np.linalg.norm(seen, axis=0)
    size[size == 0] = 1.0
    inverse = np.linalg.pinv((seen / size).T @ (seen / size), hermitian=True)
    own = x / size
    return np.sum(own @ inverse * own, axis=1) * len(seen) / x.shape[1]


def _robust(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Least squares with weights of a Student density (nu = 2): coefficients and usual error."""
    size = np.linalg.norm(x, axis=0)
    size[size == 0] = 1.0
    weight, p, scale = np.ones(len(y)), np.zeros(x.shape[1]), 0.0
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)
        p = np.linalg.lstsq(x / size * root[:, None], y * root, rcond=1e-9)[0] / size
        r = y - x @ p
        scale = 1.4826 * float(np.median(np.abs(r))) + 1e-12 * float(np.abs(y).max())
        if not scale > 0:
            break
        weight = 3.0 / (2.0 + (r / scale) ** 2)
    return p, scale


def _kernel(width: int, order: int) -> np.ndarray:
    """Weights on samples -width..width for the average, the slope or the curvature of a signal,
    exact for parabolas."""
    s = np.arange(-width, width + 1) / (width + 1)
    bump = (1 - s**2) ** 4
    powers = np.vander(s, 4, increasing=True)
    want = np.zeros(4)
    want[order] = (1.0, 1.0, 2.0)[order] / (width + 1) ** order
    basis = powers * bump[:, None]
    return basis @ np.linalg.solve(powers.T @ basis, want)


def _over(x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """The windows about each sample; NaN where they reach beyond the ends."""
    half = len(kernel) // 2
    made = np.full(len(x), np.nan)
    if len(x) > 2 * half:
        middle = x[len(x) // 2]
        made[half : len(x) - half] = np.convolve(x - middle, kernel[::-1], "valid")
        made[half : len(x) - half] += middle * kernel.sum()
    return made
