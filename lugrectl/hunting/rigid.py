"""Limit cycles of a PID loop around a rigid drive: all that stick, and swings that do not.

Those never stick: at each w = 0 the torque is above Fs, and the state there has two numbers, the
error and the excess of the torque. Newton on the half turn starts where motions that never stick
come closest to repeating, and so do motions from the border between rest and growth, which follow
an unstable cycle for a while.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .loop import PROBED, Lanes, Loop
from .result import Cycle, LimitCycles
from .stick_map import NEVER, STICKS, excess, excess_on, half_turn, slip, turns

LOW, HIGH = 1e-3, 30.0  # units: the grid, and beyond as far as friction can keep up an error
POINTS = 140  # of the grid
DIP = 1.5  # |D| of an extremum between grid points that may reach zero
PARTS = 16  # into which a bracket is cut at a time
DEEPER, CLOSER = 4, 6  # cuts around an extremum, and of a bracket
ENOUGH = 2  # cuts for a border of rest or growth, which has no root
JUMP = 1e-3  # |D| at the end of the cuts: not a root
AWAY = 1e-4  # relative distance at which a multiplier is measured
CLOSE = np.r_[-np.geomspace(0.3, 1e-3, 12), np.geomspace(1e-3, 0.3, 12)]  # of a fixed point
ONE_POINT = 1e-4  # relative difference of two fixed points that are one
NEWTON, REPEATS = 15, 1e-6  # of Newton, and the relative distance of a half turn that repeats


class Fixed(NamedTuple):
    """A cycle in units: breakaway, multiplier of one round of the map and of a whole turn,
    amplitude (half the peak to peak), period and stops in it."""

    x: float
    multiplier: float
    turn: tuple[float, ...]
    amplitude: float
    period: float
    stops: int


def _double_points(
    lanes: Lanes, x: np.ndarray, D: np.ndarray, fixed: list[Fixed], jumps: np.ndarray
) -> list[Fixed]:
    """Fixed points of T(T) that are none of T: two unequal half turns."""
    inside = np.abs(D) < NEVER  # there log(T(T(e))/e) = D(e) + D(T(e)) is interpolated
    ahead = np.interp(np.log(x) + np.where(inside, D, 0.0), np.log(x), D)
    twice = np.where(inside, D + ahead, D)
    # on either side of a fixed point of T with a multiplier below -1, maybe close
    near = np.array([f.x * (1 + k) for f in fixed if f.multiplier < -1.0 for k in CLOSE])
    if len(near):
        x, twice = np.r_[x, near], np.r_[twice, excess(lanes.many(len(near)), near, 2)]
        x, twice = x[np.argsort(x)], twice[np.argsort(x)]
    turned = _turned(twice)
    about = np.unique(np.clip(turned[:, None] + np.arange(-1, 3), 0, len(x) - 1))
    if len(about):  # interpolated ends may change their sign
        twice[about] = excess(lanes.many(len(about)), x[about], 2)
    made: list[Fixed] = []
    known = [*(f.x for f in fixed), *jumps]
    for one in _described(lanes, _roots(lanes, x, twice, 2, known)[0], 2):
        double = any(abs(k.period / one.period - 1.0) < ONE_POINT for k in made)
        if not double and all(abs(one.x / f.x - 1.0) > ONE_POINT for f in fixed):
            made.append(one)  # a cycle e1 -> e2 -> e1 appears at both of its errors
    return made


def _turned(D: np.ndarray) -> np.ndarray:
    return np.flatnonzero((D[:-1] > 0.0) != (D[1:] > 0.0))


def _with_extrema(lanes: Lanes, x: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The grid with the extrema between its points that come near zero: close pairs of roots."""
    inner, size = np.arange(1, len(x) - 1), np.abs(D)
    dips = (size[inner] < size[inner - 1]) & (size[inner] <= size[inner + 1]) & (size[inner] < DIP)
    at = inner[dips & (D[inner - 1] * D[inner] > 0) & (D[inner] * D[inner + 1] > 0)]
    low, high, sign, now = np.log(x[at - 1]), np.log(x[at + 1]), np.sign(D[at]), D[at]
    for _ in range(DEEPER):
        if not len(now):
            break
        cut, row, before = np.linspace(low, high, PARTS + 1, axis=1), np.arange(len(now)), now
        values = excess(lanes.many(cut.size), np.exp(cut).ravel()).reshape(cut.shape)
        best = np.argmin(sign[:, None] * values, axis=1)
        now = values[row, best]
        x, D = np.r_[x, np.exp(cut[row, best])], np.r_[D, now]
        low, high = cut[row, np.maximum(best - 1, 0)], cut[row, np.minimum(best + 1, PARTS)]
        # a cut brings an extremum closer by less than the cut before
        left = (sign * now > 0.0) & (np.abs(now) < np.abs(now - before))
        low, high, sign, now = low[left], high[left], sign[left], now[left]
    order_of = np.argsort(x, kind="stable")
    return x[order_of], D[order_of]


def _roots(
    lanes: Lanes, x: np.ndarray, D: np.ndarray, order: int, known: Sequence[float] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """The roots of D between points, other than known ones, and where it jumps over zero."""
    turned = np.setdiff1d(_turned(D), np.searchsorted(x, known) - 1)
    Da, Db = D[turned], D[turned + 1]
    low, high = np.log(x[turned]), np.log(x[turned + 1])
    for k in range(CLOSER):
        smooth = np.maximum(np.abs(Da), np.abs(Db)) < NEVER
        left = np.flatnonzero(smooth | (k < ENOUGH))
        if not len(left):
            break
        cut, row = np.linspace(low[left], high[left], PARTS + 1, axis=1), np.arange(len(left))
        inside = np.exp(cut[:, 1:-1])
        values = excess(lanes.many(inside.size), inside.ravel(), order).reshape(inside.shape)
        every = np.column_stack([Da[left], values, Db[left]])
        at = np.argmax((every > 0.0) != (Da[left] > 0.0)[:, None], axis=1)
        low[left], high[left] = cut[row, at - 1], cut[row, at]
        Da[left], Db[left] = every[row, at - 1], every[row, at]
    x = np.exp(low + (high - low) * Da / (Da - Db))
    jumps = np.maximum(np.abs(Da), np.abs(Db)) > JUMP
    return x[~jumps], x[jumps]


def _described(lanes: Lanes, x: np.ndarray, order: int) -> list[Fixed]:
    """Multiplier and motion of each root."""
    three = np.concatenate([x * (1.0 - AWAY), x, x * (1.0 + AWAY)])
    made = turns(lanes.many(len(three)), three, order)
    before, at, after = (np.arange(len(x)) + k * len(x) for k in range(3))
    sticks = made.fate == STICKS  # beside a border, only one of the neighbours does
    low, high = (np.where(sticks[k], k, at) for k in (before, after))
    slope = (made.x[high] - made.x[low]) / np.maximum(three[high] - three[low], AWAY * x)
    whole = 2 // order  # rounds in a period
    sides = np.array([made.high, made.low])  # alike in a symmetric cycle, of which this is half
    wide = sides.max(axis=0) if order == 1 else sides.mean(axis=0)
    rows = np.column_stack([made.x, wide, whole * made.t, whole * made.stops])[at].tolist()
    return [
        Fixed(e, mu, (mu**whole,), size, period, int(stops))
        for (e, size, period, stops), mu, is_stick in zip(
            rows, slope.tolist(), sticks[at], strict=True
        )
        if is_stick
    ]


class Half(NamedTuple):
    """Half turns: the states at their ends with signs changed (n, k), times, largest errors."""

    x: np.ndarray
    t: np.ndarray
    size: np.ndarray


def repeated(
    half: Callable[[np.ndarray], Half | None],
    x: np.ndarray,
    nudge: Callable[[np.ndarray], np.ndarray],
    scale: np.ndarray,
) -> tuple[float, float, np.ndarray] | None:
    """Find the state near x (n,) that half a turn repeats, by Newton with slopes over ``nudge(x)``:
    amplitude, period, and the multipliers of a turn, the largest first."""
    for _ in range(NEWTON):
        steps = nudge(x)
        made = half(np.column_stack([x, x[:, None] + np.diag(steps)]))
        if made is None:
            return None
        A, missed = (made.x[:, 1:] - made.x[:, :1]) / steps, made.x[:, 0] - x
        if np.abs(missed / scale).max() < REPEATS * abs(x[0]) / scale[0]:
            turn = np.linalg.eigvals(A) ** 2
            ends = float(made.size[0]), 2.0 * float(made.t[0])
            return *ends, turn[np.argsort(-np.abs(turn))]
        step = np.linalg.solve(A - np.eye(len(x)), -missed)
        x = x + step * min(1.0, 0.5 * abs(x[0]) / (abs(step[0]) + 1e-300))
    return None


COULOMB = (
    "Coulomb and viscous friction alone, with kd kp > ki J: the rest is globally asymptotically "
    "stable (Bisoffi, Da Lio, Teel and Zaccarian, IEEE Trans. Automatic Control 63(8), 2018)"
)
NO_INTEGRAL = (
    "without integral action the energy J w^2/2 + kp e^2/2 falls in every motion, since "
    "(kd w + F(w)) w > 0"
)
ROUNDS, AGAIN = 300, 30  # of T, interpolated and itself: what has not come to rest persists
NEAR = 10.0  # |D| of a half turn that neither rests nor grows
STARTS = 3  # from which T itself is iterated
BEYOND = 10.0  # times the largest start: a swing that grows without bound
SWINGS, SEEDS = 100, 4  # that are followed, and errors from which no stick followed, at most
NUDGE = 1e-5  # relative, by which a slope is measured
ALIKE = 1e-6  # relative change from swing to swing, below which it repeats
SAME = 1e-3  # relative difference of two amplitudes that are one


def proven(loop: Loop) -> str | None:
    """Return why the loop has no limit cycle, where that is known."""
    if loop.ki == 0.0:
        damped = np.all(loop.kd * PROBED + loop.curve.torque(PROBED) > 0.0)
        return NO_INTEGRAL if damped else None
    return COULOMB if loop.curve.is_straight() and loop.is_stable() else None


def rigid_cycles(loop: Loop) -> LimitCycles:
    """Find the cycles of the loop, or the proof that there is none."""
    proof = proven(loop)
    if proof:
        return LimitCycles((), None, proof, False, {})
    diverges = not loop.is_stable()
    high = HIGH if diverges else max(HIGH, loop.largest[1])
    lanes = replace(loop.lanes(1), large=BEYOND * high)
    grid = np.geomspace(LOW, high, round(POINTS * np.log(high / LOW) / np.log(HIGH / LOW)))
    D = excess_on(lanes.many(len(grid)), grid)[0]
    rests = np.cumprod(D <= -NEVER).sum()  # sticks up to here come to rest at once
    calm = replace(lanes, calm=float(grid[rests - 1]) if rests else 0.0)
    x, D = _with_extrema(calm, grid, D)
    roots, jumps = _roots(calm, x, D, 1)
    fixed = _described(calm, roots, 1)
    double = _double_points(calm, x, D, fixed, jumps)
    cycles = [
        Cycle(f.amplitude * loop.unit, f.period / loop.wn, abs(f.turn[0]) < 1.0, f.turn, f.stops)
        for f in [*fixed, *double, *_swinging(lanes, x[D >= NEVER], jumps)]
    ]
    if not any(c.stable for c in cycles) and np.any(D > 0.0) and not diverges:
        cycles += _persisting(loop, lanes, x, D)
    said = ("large motions grow without bound: kd kp > ki J does not hold",) * diverges
    hunts = diverges or any(c.stable for c in cycles)
    basin = _border(x, D, [*(f.x for f in fixed), *jumps]) if hunts else None
    cycles = tuple(sorted(cycles, key=lambda c: c.amplitude))
    curve = (x * loop.unit, D)
    return LimitCycles(cycles, basin and basin * loop.unit, None, diverges, {}, said, curve=curve)


def _border(x: np.ndarray, D: np.ndarray, places: list[float]) -> float | None:
    """The smallest error at which D becomes positive; 0 where it is from the first on."""
    up = np.flatnonzero(D > 0.0)
    if not len(up) or up[0] == 0:
        return 0.0 if len(up) else None
    low, high = x[up[0] - 1], x[up[0]]
    return next((float(r) for r in places if low <= r <= high), float(high))


def kept(x: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Return the errors that iterating T keeps, as it is interpolated on the grid of D."""
    place, at = np.log(x), np.log(x)
    for _ in range(ROUNDS):
        growth = np.interp(at, place, D)
        at = (at + growth)[(np.abs(growth) < NEAR) & (at + growth > np.log(LOW))]
    return np.exp(at)


def _persisting(loop: Loop, lanes: Lanes, x: np.ndarray, D: np.ndarray) -> list[Cycle]:
    """Hunting that repeats after more than two half turns, or never: T iterated from what its
    interpolation keeps."""
    at = kept(x, D)
    at = np.quantile(at, np.linspace(0.0, 1.0, STARTS)) if len(at) else at
    made = half_turn(lanes.many(len(at)), at)
    for _ in range(AGAIN):
        stays = (made.fate == STICKS) & (made.x > LOW)
        if not stays.any():
            return []
        made = half_turn(lanes.many(int(stays.sum())), made.x[stays])
    size = float(np.maximum(made.high, made.low).max())
    return [Cycle(size * loop.unit, float(2.0 * made.t.mean()) / loop.wn, True)]


def _swinging(lanes: Lanes, never: np.ndarray, borders: np.ndarray) -> list[Fixed]:
    """The cycles that never stick, by errors from which no stick followed."""
    if not len(never):
        return []
    some = never[np.unique(np.linspace(0, len(never) - 1, SEEDS).astype(int))]

    def half(state: np.ndarray) -> Half | None:
        new, t = _swing(lanes, state)
        return Half(new, t, state[0]) if np.isfinite(new).all() and np.all(state > 0.0) else None

    seeds = _seeds(lanes, np.r_[some, borders])
    found = [repeated(half, x, lambda x: np.full(2, NUDGE * x[0]), np.ones(2)) for x in seeds]
    made: list[Fixed] = []
    for size, period, turn in sorted((f for f in found if f), key=lambda f: f[0]):
        if not made or abs(size / made[-1].amplitude - 1.0) > SAME:
            sizes = tuple(np.abs(turn).tolist())
            made.append(Fixed(size, sizes[0], sizes, size, period, 0))
    return made


def _swing(lanes: Lanes, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The next state at w = 0 of each (2, n), signs changed, and the time; nan where it sticks."""
    end = slip(lanes.many(state.shape[1]), *state)
    new = np.array([-end.x, -2.0 - end.y])
    lost = end.rests | (new[0] <= 0.0) | (new[1] <= 0.0) | (new[0] > lanes.large)
    return np.where(lost, np.nan, new), end.t


def _seeds(lanes: Lanes, at: np.ndarray) -> list[np.ndarray]:
    """From each error the state at which a swing changed least."""
    state, least = np.array([at, 0.0 * at]), np.full(len(at), np.inf)
    best = np.full_like(state, np.nan)
    for _ in range(SWINGS):
        new, _ = _swing(lanes, state)
        change = np.abs(new - state).sum(axis=0) / state[0]
        better = change < least
        least, best = np.where(better, change, least), np.where(better, new, best)
        goes = np.isfinite(new[0]) & (change > ALIKE)
        if not goes.any():
            break
        state = np.where(goes, new, state)
    return [seed for seed in best.T if np.isfinite(seed).all()]
