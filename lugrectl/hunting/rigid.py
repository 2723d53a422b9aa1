"""Limit cycles of a PID loop around a rigid drive: all that stick, and swings that do not.

Those never stick: at each w = 0 the torque is above Fs, and the state there has two numbers, the
error and the excess of the torque. Newton on the half turn starts where motions that never stick
come closest to repeating, and so do motions from the border between rest and growth, which follow
an unstable cycle for a while.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .fixed_points import HIGH, LOW, Fixed, Half, fixed_points, repeated
from .loop import PROBED, Lanes, Loop
from .result import Cycle, LimitCycles
from .slip import slip
from .stick_map import NEVER, STICKS, half_turn

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
    """Find the cycles of the loop, or the proof that there is none: from a thousandth of the error
    at which kp alone breaks away up to the largest that friction can keep up.
    """
    proof = proven(loop)
    if proof:
        return LimitCycles((), None, proof, False, {})
    diverges = not loop.is_stable()
    high = HIGH if diverges else max(HIGH, loop.reach)
    lanes = replace(loop.lanes(1), large=BEYOND * high)
    one = fixed_points(lanes, high)
    swings = _swinging(lanes, one.x[one.D >= NEVER], one.jumps)
    cycles = [_cycle(f, loop) for f in [*one.fixed, *one.double, *swings]]
    if not any(c.stable for c in cycles) and np.any(one.D > 0.0) and not diverges:
        cycles += _persisting(loop, lanes, one.x, one.D)
    said = ("large motions grow without bound: kd kp > ki J does not hold",) * diverges
    hunts = diverges or any(c.stable for c in cycles)
    basin = _border(one.x, one.D, [*(f.x for f in one.fixed), *one.jumps]) if hunts else None
    cycles = tuple(sorted(cycles, key=lambda c: c.amplitude))
    curve = (one.x * loop.unit, one.D)
    return LimitCycles(cycles, basin and basin * loop.unit, None, diverges, {}, said, curve=curve)


def _cycle(f: Fixed, loop: Loop) -> Cycle:
    size, time = f.amplitude * loop.unit, f.period / loop.wn
    return Cycle(size, time, abs(f.turn[0]) < 1.0, f.turn, f.stops)


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


def _swinging(lanes: Lanes, never: np.ndarray, borders: list[float]) -> list[Fixed]:
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
