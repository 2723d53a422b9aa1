"""Limit cycles of a PID loop around a rigid drive: all that stick, and swings that do not."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .curve import PROBED
from .fixed_points import HIGH, LOW, Fixed, double_points, fixed_points
from .lanes import Lanes, Loop
from .result import Cycle
from .stick_map import STICKS, half_turn
from .swings import swinging

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


class Answer(NamedTuple):
    """What was found in a loop; errors in rad. ``undecided`` starts neither rested nor repeated."""

    cycles: list[Cycle]
    basin: float | None
    proof: str | None
    diverges: bool
    messages: list[str]
    curve: tuple[np.ndarray, np.ndarray] | None
    undecided: int = 0


def proven(loop: Loop) -> str | None:
    """Why the loop has no limit cycle, where that is known."""
    if loop.ki == 0.0:
        damped = np.all(loop.kd * PROBED + loop.curve.torque(PROBED) > 0.0)
        return NO_INTEGRAL if damped else None
    straight = loop.curve.is_straight()
    return COULOMB if straight and loop.is_stable() else None


def rigid_cycles(loop: Loop) -> Answer:
    """The cycles of the loop, or the proof that there is none: from a thousandth of the error at
    which kp alone breaks away up to the largest that friction can keep up.
    """
    proof = proven(loop)
    if proof:
        return Answer([], None, proof, False, [], None)
    diverges, said = not loop.is_stable(), []
    high = HIGH if diverges else max(HIGH, loop.reach)
    lanes = replace(loop.lanes(1), large=BEYOND * high)
    one = fixed_points(lanes, high)
    cycles = [_cycle(f, loop) for f in [*one.fixed, *double_points(lanes, one)]]
    cycles += [_swing(s, loop) for s in swinging(lanes, one.x, one.D, one.jumps)]
    if not any(c.stable for c in cycles) and np.any(one.D > 0.0) and not diverges:
        cycles += _persisting(loop, lanes, one.x, one.D)
    if diverges:
        said.append("large motions grow without bound: kd kp > ki J does not hold")
    hunts = diverges or any(c.stable for c in cycles)
    basin = _border(one.x, one.D, [f.x for f in one.fixed], one.jumps) if hunts else None
    cycles.sort(key=lambda c: c.amplitude)
    x = one.x * loop.unit
    return Answer(cycles, basin and basin * loop.unit, None, diverges, said, (x, one.D))


def _cycle(f: Fixed, loop: Loop) -> Cycle:
    whole = f.multiplier ** (2 // f.order)  # T is half a turn
    size, time = f.amplitude * loop.unit, f.period / loop.wn
    return Cycle(size, time, abs(whole) < 1.0, (whole,), f.stops)


def _swing(found: tuple[float, float, tuple[float, ...]], loop: Loop) -> Cycle:
    size, time, turn = found
    return Cycle(size * loop.unit, time / loop.wn, turn[0] < 1.0, turn, 0)


def _border(x: np.ndarray, D: np.ndarray, roots: list[float], jumps: list[float]) -> float | None:
    """The smallest error at which D becomes positive; 0 where it is from the first on."""
    up = np.flatnonzero(D > 0.0)
    if not len(up):
        return None
    if up[0] == 0:
        return 0.0
    low, high = x[up[0] - 1], x[up[0]]
    return next((float(r) for r in [*roots, *jumps] if low <= r <= high), float(high))


def kept(x: np.ndarray, D: np.ndarray) -> np.ndarray:
    """The errors that iterating T keeps, as it is interpolated on the grid of D."""
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
    made = half_turn(lanes[np.zeros(len(at), int)], at)
    for _ in range(AGAIN):
        stays = (made.fate == STICKS) & (made.x > LOW)
        if not stays.any():
            return []
        made = half_turn(lanes[np.zeros(int(stays.sum()), int)], made.x[stays])
    size = float(np.maximum(made.high, made.low).max())
    return [Cycle(size * loop.unit, float(2.0 * made.t.mean()) / loop.wn, True)]
