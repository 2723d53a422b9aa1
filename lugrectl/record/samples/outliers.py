"""Samples that cannot be values of their channel: marks of a missing value and single outliers."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

HUGE = 1e30  # in SI units; larger numbers stand for a missing value
_AROUND = 61  # rows about a sample that show what is usual there
_FAR = 10.0  # times the usual distance from the curve through the neighbours
_EVEN = 1e-6  # of a step: stamps that differ by less are even
_RARE = 0.97  # share of the samples that shows how far from the curve the channel is anyway
# least distance of an outlier, as a share of the channel's range: a drive may ask for a short
# torque, and a computed speed may jump, but a position has inertia behind it
_SHARE = {"u": 0.06, "w": 0.03}


def huge(x: np.ndarray) -> np.ndarray:
    """Where the number is one that no sensor gives, such as 1e30 or the largest float."""
    with np.errstate(invalid="ignore"):
        return np.isfinite(x) & (np.abs(x) >= HUGE)


def bridged(x: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """The channel with straight lines over its bad samples."""
    if not bad.any() or bad.all():
        return x
    rows = np.arange(len(x))
    return np.interp(rows, rows[~bad], x[~bad])


def spread(x: np.ndarray) -> float:
    """The range of a channel without its rarest values, which may be none of it."""
    low, high = np.quantile(x, [0.01, 0.99])
    return float(high - low) or float(np.ptp(x))


def quantum(x: np.ndarray) -> float:
    """The step of the lattice that the values of a channel (N,) lie on; 0 if there is none."""
    values = np.unique(x[:: max(1, len(x) // 20_000)])
    if len(values) < 3:
        return 0.0
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * spread(values)]
    if len(steps) < 2:
        return 0.0
    unit = float(np.median(steps[steps <= 1.5 * np.quantile(steps, 0.05)]))
    near = steps[steps < 20.5 * unit] / unit
    return unit if np.mean(np.abs(near - np.rint(near)) < 0.1) > 0.9 else 0.0


def resolution(x: np.ndarray) -> float:
    """The smallest change that the channel shows: its lattice, or what its digits make of it."""
    changes = np.abs(np.diff(x))
    changes = changes[changes > 1e-9 * spread(x)]
    return max(quantum(x), float(np.quantile(changes, 0.02))) if len(changes) else 0.0


def outliers(role: str, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Where single samples of a channel (N,), all finite, are far off their neighbours.

    Such a sample lies outside the middle of its neighbours and off the cubic through four of
    them, in rows and in stamps ``t`` (s), by far more than other samples near it or anywhere in
    the channel; it does not go on from the rows on either side. In the motion, up to four in a
    row may be so.
    """
    if len(x) < 16 or np.ptp(x) == 0:
        return np.zeros(len(x), bool)
    far = distances(t, x)
    low, high = np.quantile(x, [0.01, 0.99])
    limit = limits(role, x) + 3 * np.quantile(far, _RARE)
    bad = far > limit
    if role == "u":  # the first torque and the last have neighbours on one side only
        ends = [0, len(x) - 1]
        bad[ends] &= far[ends] > high - low
        return bad  # a torque may be a pulse of a few rows
    return bad | _brief(x, limit)


def _brief(x: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Where two to four samples in a row lie beyond those on either side, all the same way."""
    bad = np.zeros(len(x), bool)
    for rows in (2, 3, 4):
        before, after = x[: -rows - 1], x[rows + 1 :]
        least, most = x[1:-rows], x[1:-rows]
        for k in range(1, rows):  # far quicker than a reduction over so few samples
            own = x[1 + k : len(x) - rows + k]
            least, most = np.minimum(least, own), np.maximum(most, own)
        above = least - np.maximum(before, after)
        below = np.minimum(before, after) - most
        found = np.flatnonzero(np.maximum(above, below) > limit[1 : len(least) + 1]) + 1
        for row in found:
            bad[row : row + rows] = True
    return bad


def distances(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """How far each sample is from what its neighbours say, the nearest of five statements.

    Beside a jump that stays, a sample goes on from the rows on one side.
    """
    beside = np.array([1, 1, 1, 0, 1, 1, 1], bool)
    low = ndimage.rank_filter(x, 2, footprint=beside, mode="mirror")
    high = ndimage.rank_filter(x, 3, footprint=beside, mode="mirror")
    far, steps = np.fmin(outside(x, low, high), _off_cubic(x)), np.diff(t)
    if np.ptp(steps) > _EVEN * np.abs(steps).max():  # else the stamps say the same as the rows
        far = np.fmin(far, off_cubic_in_time(t, x))
    far[2:] = np.fmin(far[2:], outside(x[2:], x[1:-1], 2 * x[1:-1] - x[:-2]))
    far[:-2] = np.fmin(far[:-2], outside(x[:-2], x[1:-1], 2 * x[1:-1] - x[2:]))
    for end, then, after, last in ((0, 1, 2, 3), (-1, -2, -3, -4)):
        near = outside(x[end], x[then], 2 * x[then] - x[after])
        far[end] = min(near, outside(x[end], x[after], 3 * x[after] - 2 * x[last]))
        far[then] = outside(x[then], x[end], x[after])
    return far


def outside(x: np.ndarray | float, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distance from the interval between two values; 0 inside."""
    return np.maximum(np.maximum(np.minimum(one, other) - x, x - np.maximum(one, other)), 0.0)


def _off_cubic(x: np.ndarray) -> np.ndarray:
    """Distance from the cubic through two samples on either side, with even steps."""
    weights = np.array([1.0, -4.0, 0.0, -4.0, 1.0]) / 6
    return np.abs(x + ndimage.convolve1d(x, weights, mode="mirror"))


def off_cubic_in_time(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The same with the recorded stamps; nan where they do not allow it."""
    made = np.full(len(x), np.nan)
    beside = [sliding(t, k) - t[2:-2] for k in (0, 1, 3, 4)]
    value = np.zeros(len(x) - 4)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for i, (k, own) in enumerate(zip((0, 1, 3, 4), beside, strict=True)):
            share = np.ones(len(value))
            for other in (b for j, b in enumerate(beside) if j != i):
                share *= other / (other - own)
            value += share * sliding(x, k)
    made[2:-2] = np.abs(x[2:-2] - value)
    return made


def sliding(x: np.ndarray, first: int) -> np.ndarray:
    """The samples that are ``first`` - 2 places after those from the third to the last but two."""
    return x[first : len(x) - 4 + first]


def limits(role: str, x: np.ndarray) -> np.ndarray:
    """How far a sample may be from its neighbours, judged by those about it."""
    curve = _off_cubic(x)
    around = min(_AROUND, len(x) // 2 * 2 - 1)
    usual = ndimage.median_filter(curve, around, mode="mirror")
    usual = np.maximum(usual, 0.3 * np.median(curve[curve > 0]) if curve.any() else 0.0)
    steps = ndimage.median_filter(np.abs(np.diff(x, append=x[-1])), around, mode="mirror")
    low, high = np.quantile(x, [0.01, 0.99])
    least = _SHARE.get(role, 0.0) * (high - low) + 6 * resolution(x) + 1e-9 * spread(x)
    return _FAR * usual + steps + least
