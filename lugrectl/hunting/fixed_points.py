"""Fixed points of the half-turn map T on a logarithmic grid: where D(e) = log(T(e)/e) is zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from .lanes import Lanes
from .stick_map import NEVER, STICKS, excess, excess_on, turns

LOW, HIGH = 1e-3, 30.0  # units: the grid, and beyond as far as friction can keep up an error
POINTS = 140  # of the grid
NEAR = 1.5  # |D| of an extremum between grid points that may reach zero
PARTS = 16  # into which a bracket is cut at a time
DEEPER, CLOSER = 4, 6  # cuts around an extremum, and of a bracket
ENOUGH = 2  # cuts for a border of rest or growth, which has no root
JUMP = 1e-3  # |D| at the end of the cuts: not a root
AWAY = 1e-4  # relative distance at which a multiplier is measured
CLOSE = np.r_[-np.geomspace(0.3, 1e-3, 12), np.geomspace(1e-3, 0.3, 12)]  # of a fixed point
SAME = 1e-4  # relative difference of two fixed points that are one


@dataclass(frozen=True)
class Fixed:
    """A fixed point of T or T(T), in units: breakaway, multiplier of one round of the map,
    amplitude (half the peak to peak), period, stops and reversals in a whole period."""

    x: float
    multiplier: float
    amplitude: float
    period: float
    stops: int
    reversals: int
    order: int


class Found(NamedTuple):
    """Fixed points, errors at which T jumps over the diagonal, and the curve D on the grid."""

    fixed: list[Fixed]
    jumps: list[float]
    x: np.ndarray
    D: np.ndarray


def fixed_points(lanes: Lanes, high: float = HIGH) -> Found:
    """All sign changes of D on a grid up to ``high``; ``lanes`` has one lane of the loop."""
    grid = np.geomspace(LOW, high, round(POINTS * np.log(high / LOW) / np.log(HIGH / LOW)))
    D = excess_on(_many(lanes, len(grid)), grid)[0]
    lanes = replace(lanes, calm=calm(grid, D))
    x, D = _with_extrema(lanes, grid, D)
    roots, jumps = _roots(lanes, x, D, 1)
    return Found(_described(lanes, roots, 1), list(jumps), x, D)


def calm(x: np.ndarray, D: np.ndarray) -> float:
    """The error up to which all sticks come to rest at once; 0 where there is none."""
    rests = np.cumprod(D <= -NEVER).sum()
    return float(x[rests - 1]) if rests else 0.0


def double_points(lanes: Lanes, found: Found) -> list[Fixed]:
    """Fixed points of T(T) that are none of T: two unequal half turns.

    On the grid log(T(T(e))/e) = D(e) + D(T(e)) is interpolated; where a fixed point of T has a
    multiplier below -1, one is on either side of it, maybe close.
    """
    x, D = found.x, found.D
    lanes = replace(lanes, calm=calm(x, D))
    inside = np.abs(D) < NEVER
    ahead = np.interp(np.log(x) + np.where(inside, D, 0.0), np.log(x), D)
    twice = np.where(inside, D + ahead, D)
    near = np.array([f.x * (1 + k) for f in found.fixed if f.multiplier < -1.0 for k in CLOSE])
    if len(near):
        x, twice = np.r_[x, near], np.r_[twice, excess(_many(lanes, len(near)), near, 2)]
        x, twice = x[np.argsort(x)], twice[np.argsort(x)]
    turned = np.flatnonzero((twice[:-1] > 0.0) != (twice[1:] > 0.0))
    about = np.unique(np.clip(turned[:, None] + np.arange(-1, 3), 0, len(x) - 1))
    if len(about):  # interpolated ends may change their sign
        twice[about] = excess(_many(lanes, len(about)), x[about], 2)
    known = [*(f.x for f in found.fixed), *found.jumps]
    made: list[Fixed] = []
    for one in _described(lanes, _roots(lanes, x, twice, 2, known)[0], 2):
        double = any(abs(k.period / one.period - 1.0) < SAME for k in made)
        if not double and all(abs(one.x / f.x - 1.0) > SAME for f in found.fixed):
            made.append(one)  # a cycle e1 -> e2 -> e1 appears at both of its errors
    return made


def _many(lanes: Lanes, count: int) -> Lanes:
    return lanes[np.zeros(count, int)]


def _with_extrema(lanes: Lanes, x: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The grid with the extrema between its points that come near zero: close pairs of roots.

    A cut brings an extremum closer by less than the cut before; where that is not enough to reach
    zero, it is left.
    """
    inner, size = np.arange(1, len(x) - 1), np.abs(D)
    dips = (size[inner] < size[inner - 1]) & (size[inner] <= size[inner + 1]) & (size[inner] < NEAR)
    at = inner[dips & (D[inner - 1] * D[inner] > 0) & (D[inner] * D[inner + 1] > 0)]
    if not len(at):
        return x, D
    low, high, sign, now = np.log(x[at - 1]), np.log(x[at + 1]), np.sign(D[at]), D[at]
    for _ in range(DEEPER):
        cut = np.linspace(low, high, PARTS + 1, axis=1)
        values = excess(_many(lanes, cut.size), np.exp(cut).ravel()).reshape(cut.shape)
        best = np.argmin(sign[:, None] * values, axis=1)
        row, before = np.arange(len(best)), now
        now = values[row, best]
        x, D = np.r_[x, np.exp(cut[row, best])], np.r_[D, now]
        low, high = cut[row, np.maximum(best - 1, 0)], cut[row, np.minimum(best + 1, PARTS)]
        left = (sign * now > 0.0) & (np.abs(now) < np.abs(now - before))
        low, high, sign, now = low[left], high[left], sign[left], now[left]
        if not left.any():
            break
    order_of = np.argsort(x, kind="stable")
    return x[order_of], D[order_of]


def _roots(
    lanes: Lanes, x: np.ndarray, D: np.ndarray, order: int, known: Sequence[float] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """The roots of D between points, other than known ones, and where it jumps over zero."""
    turned = np.flatnonzero((D[:-1] > 0.0) != (D[1:] > 0.0))
    turned = np.setdiff1d(turned, np.searchsorted(x, known) - 1)
    if not len(turned):
        return x[:0], x[:0]
    a, b, Da, Db = x[turned], x[turned + 1], D[turned], D[turned + 1]
    low, high = np.log(a), np.log(b)
    for k in range(CLOSER):
        smooth = np.maximum(np.abs(Da), np.abs(Db)) < NEVER
        left = np.flatnonzero(smooth | (k < ENOUGH))
        if not len(left):
            break
        cut, row = np.linspace(low[left], high[left], PARTS + 1, axis=1), np.arange(len(left))
        inside = np.exp(cut[:, 1:-1])
        values = excess(_many(lanes, inside.size), inside.ravel(), order).reshape(inside.shape)
        every = np.column_stack([Da[left], values, Db[left]])
        at = np.argmax((every > 0.0) != (Da[left] > 0.0)[:, None], axis=1)
        low[left], high[left] = cut[row, at - 1], cut[row, at]
        Da[left], Db[left] = every[row, at - 1], every[row, at]
    x = np.exp(low + (high - low) * Da / (Da - Db))
    jumps = np.maximum(np.abs(Da), np.abs(Db)) > JUMP
    return x[~jumps], x[jumps]


def _described(lanes: Lanes, x: np.ndarray, order: int) -> list[Fixed]:
    """Multiplier and motion of each root."""
    if not len(x):
        return []
    three = np.concatenate([x * (1.0 - AWAY), x, x * (1.0 + AWAY)])
    made = turns(_many(lanes, len(three)), three, order)
    before, at, after = (np.arange(len(x)) + k * len(x) for k in range(3))
    sticks = made.fate == STICKS  # beside a border, only one of the neighbours does
    low, high = (np.where(sticks[k], k, at) for k in (before, after))
    slope = (made.x[high] - made.x[low]) / np.maximum(three[high] - three[low], AWAY * x)
    whole = 2 // order  # rounds in a period
    sides = np.array([made.high, made.low])  # alike in a symmetric cycle, of which this is half
    wide = sides.max(axis=0) if order == 1 else sides.mean(axis=0)
    return [
        Fixed(
            float(made.x[i]),
            float(mu),
            float(wide[i]),
            float(whole * made.t[i]),
            int(whole * made.stops[i]),
            int(whole * made.reversals[i]),
            order,
        )
        for i, mu in zip(at, slope, strict=True)
        if made.fate[i] == STICKS
    ]
