"""Motion under a held torque: coast-down, in which there is none and the motion dies out, for the
friction of each unit of inertia; steps and pulses, for inertia and friction."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ...blocks.block import unit_for
from ...core.numeric import rms
from ...estimates.bench_test import ALONE, BenchTest, in_words
from ...estimates.findings import Estimate
from .momentum import EXPLAINED, Fitted, Stroke, best, interval, stroked
from .motion import Motion, Piece

# ---- coast-down ------------------------------------------------------------------

DIES = 0.3  # of the speed at its start, to which a coast falls at least
COASTING = 0.2  # of the moving rows
ZERO = 0.02  # of the largest torque: less is none


def coasts(motions: Sequence[Motion]) -> list[Stroke]:
    """The strokes without torque in which the speed falls and does not rise again."""
    largest = max(float(np.abs(one.u).max()) for one in motions)
    found = []
    for one in motions:
        free = [p.at for p in one.pieces if p.held and abs(p.level) <= ZERO * largest]
        for piece, stroke in itertools.product(free, one.strokes):
            at = slice(max(stroke.start, piece.start), min(stroke.stop, piece.stop))
            if at.stop - at.start <= 3 * one.window:
                continue
            v = np.abs(one.v[at])
            later = np.maximum.accumulate(v[::-1])[::-1]
            if v[-1] < DIES * v[0] and np.all(later - v < 0.05 * v[0] + 3 * one.speeds[1]):
                found.append(stroked(one, at))
    return [stroke for stroke in found if stroke is not None]


def coast_down(motions: Sequence[Motion], J: float | None, motion: str) -> BenchTest | None:
    """Fc/J and Fv/J of all coasts, and both with J where it is known."""
    strokes = coasts(motions)
    moving = sum(np.count_nonzero(one.side) for one in motions)
    if not strokes or sum(s.at.stop - s.at.start for s in strokes) < COASTING * moving:
        return None
    ways = {np.sign(s.v[0]) for s in strokes}
    made = best(strokes, ("Fc", "Fv"), ("constant",) if len(ways) > 1 else ())
    if made is None or made["Fc"] <= 0 or made.unexplained > EXPLAINED:
        return None
    if made["Fv"] < -2 * made.error("Fv"):  # no friction: something else brakes
        return None
    per = {"Fc": "m/s2" if motion == "linear" else "rad/s2", "Fv": "1/s"}
    values = {f"{k}/J": interval(made[k], made.error(k), made.freedom, per[k]) for k in per}
    if J:
        for k, unit in (("Fc", "N m"), ("Fv", "N m s/rad")):
            one = values[f"{k}/J"]
            low, high = one.ci95 or (0.0, 0.0)
            values[k] = Estimate(J * one.value, unit_for(unit, motion), (J * low, J * high))
    many = f"{len(strokes)} coast-downs" if len(strokes) > 1 else "One coast-down"
    taken = f", with J = {J:.6g} {unit_for('kg m2', motion)} as declared" if J else ""
    alone = ALONE if len(ways) == 1 else ""
    return BenchTest("coast_down", f"{many}{taken}: {in_words(values)}.{alone}", values)


# ---- steps and pulses ------------------------------------------------------------

HELD = 0.9  # of the moving rows, in which the torque must be held
DRIVEN = 0.1  # of the largest torque: more drives the motion
LEVELS = 0.2  # of the largest torque, by which two levels differ
CHANGED = 0.5  # of all changes of the speed, that happen while the torque is held


def steps_and_pulses(motions: Sequence[Motion], motion: str) -> BenchTest | None:
    """J, Fc and Fv of the motion between the steps of the torque."""
    found = [(one, one.pieces) for one in motions if _is_held(one, one.pieces)]
    strokes = [s for one, _ in found for at in one.strokes if (s := stroked(one, at)) is not None]
    levels = np.sort([p.level for _, parts in found for p in parts if p.held])
    if not strokes or not np.any(np.diff(levels) > LEVELS * np.abs(levels).max(initial=0.0)):
        return None
    ways = {np.sign(s.v[0]) for s in strokes}
    both = ("constant",) if len(ways) > 1 else ()
    made = best(strokes, ("1/J", "Fc", "Fv"), (*both, "late"))
    if made is None or made["1/J"] <= 0 or made["Fc"] < 0 or made.unexplained > EXPLAINED:
        return None
    pushes = sum(p.held and p.level != 0 for _, parts in found for p in parts)
    values = _values(made, [one for one, _ in found], motion)
    alone = "" if both else ALONE
    said = f"{pushes} torque steps or pulses: {in_words(values)}.{alone}"
    return BenchTest("steps_and_pulses", said, values)


def _is_held(one: Motion, parts: Sequence[Piece]) -> bool:
    """Whether nearly all motion is under a held torque, a part of it driven by it."""
    moving = np.abs(one.side) > 0
    held = np.zeros(len(one), bool)
    for piece in parts:
        held[piece.at] = piece.held
    driven = moving & (np.abs(one.u) > DRIVEN * np.abs(one.u).max())
    if not driven.any() or held[moving].mean() < HELD:
        return False
    changed = 0.0  # of the speed, in all strokes, while the torque is held
    for stroke in one.strokes:
        for piece in (p.at for p in parts if p.held):
            first, last = max(stroke.start, piece.start), min(stroke.stop, piece.stop) - 1
            changed += abs(one.v[last] - one.v[first]) if last > first else 0.0
    v = [np.abs(one.v[at]) for at in one.strokes]
    return bool(changed > CHANGED * sum(2 * x.max() - x[0] - x[-1] for x in v))


def _values(made: Fitted, found: Sequence[Motion], motion: str) -> dict[str, Estimate]:
    J, error = 1 / made["1/J"], made.error("1/J") / made["1/J"] ** 2
    values, size = {}, max(rms(one.u) for one in found)
    register = max(one.step for one in found) / np.sqrt(12)
    values["J"] = interval(
        J, error, made.freedom, unit_for("kg m2", motion), resolution=J * register / size
    )
    for key, unit in (("Fc", "N m"), ("Fv", "N m s/rad")):
        value, error = made.ratio(key, "1/J")
        known = register if key == "Fc" else value * register / size
        values[key] = interval(value, error, made.freedom, unit_for(unit, motion), resolution=known)
    return values
