"""Limit cycles of a PID loop around a rigid drive: all that stick, and swings that do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .curve import PROBED
from .fixed_points import LOW, Fixed, double_points, fixed_points
from .lanes import Loop
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
    """The cycles of the loop, or the proof that there is none."""
    proof = proven(loop)
    if proof:
        return Answer([], None, proof, False, [], None)
    lanes, said = loop.lanes(1), []
    one = fixed_points(lanes)
    cycles = [_cycle(f, loop) for f in [*one.fixed, *double_points(lanes, one)]]
    cycles += [_swing(s, loop) for s in swinging(lanes, one.x, one.D, one.jumps)]
    diverges = not loop.is_stable()
    if not any(c.stable for c in cycles) and np.any(one.D > 0.0) and not diverges:
        cycles += _persisting(loop, one.x, one.D)
    if diverges:
        said.append("large motions grow without bound: kd kp > ki J does not hold")
    basin = _border(one.x, one.D, [f.x for f in one.fixed], one.jumps)
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


def _persisting(loop: Loop, x: np.ndarray, D: np.ndarray) -> list[Cycle]:
    """Hunting that repeats after more than two half turns, or never: what iterating T keeps.

    T is iterated as it is interpolated on the grid, and then itself from where that stays.
    """
    place, at = np.log(x), np.log(x)
    for _ in range(ROUNDS):
        growth = np.interp(at, place, D)
        at = (at + growth)[(np.abs(growth) < NEAR) & (at + growth > np.log(LOW))]
    at = np.exp(np.quantile(at, np.linspace(0.0, 1.0, STARTS))) if len(at) else at
    made = half_turn(loop.lanes(len(at)), at)
    for _ in range(AGAIN):
        stays = (made.fate == STICKS) & (made.x > LOW)
        if not stays.any():
            return []
        made = half_turn(loop.lanes(int(stays.sum())), made.x[stays])
    size = float(np.maximum(made.high, made.low).max())
    return [Cycle(size * loop.unit, float(2.0 * made.t.mean()) / loop.wn, True)]
