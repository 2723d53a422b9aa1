"""Coast-down: the torque is held, the motion dies out; friction for each unit of inertia."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ..blocks.block import unit_for
from ..estimates.bench_test import ALONE, BenchTest, in_words
from ..estimates.findings import Estimate
from .momentum import EXPLAINED, Stroke, best, interval, stroked
from .motion import Motion

DIES = 0.3  # of the speed at its start, to which a coast falls at least
COASTING = 0.2  # of the moving rows
ZERO = 0.02  # of the largest torque: less is none
KIND = "coast_down"


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
    return BenchTest(KIND, f"{many}{taken}: {in_words(values)}.{alone}", values)
