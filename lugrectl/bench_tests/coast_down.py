"""Coast-down: the torque is held, the motion dies out; friction for each unit of inertia."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..blocks.block import unit_for
from ..estimates.bench_test import ALONE, BenchTest, in_words
from ..estimates.findings import Estimate
from .momentum import EXPLAINED, Fitted, Stroke, best, constant, coulomb, interval, stroked, viscous
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
        for piece in one.pieces:
            if not piece.held or abs(piece.level) > ZERO * largest:
                continue
            for at in one.strokes:
                both = slice(max(at.start, piece.at.start), min(at.stop, piece.at.stop))
                if both.stop - both.start > 3 * one.window and _dies(one, both):
                    made = stroked(one, both)
                    found += [made] if made is not None else []
    return found


def _dies(one: Motion, at: slice) -> bool:
    v = np.abs(one.v[at])
    return bool(
        v[-1] < DIES * v[0]
        and np.all(np.maximum.accumulate(v[::-1])[::-1] - v < 0.05 * v[0] + 3 * one.speeds[1])
    )


def coast_down(motions: Sequence[Motion], J: float | None, motion: str) -> BenchTest | None:
    """Fc/J and Fv/J of all coasts, and both with J where it is known."""
    strokes = coasts(motions)
    moving = sum(np.count_nonzero(one.side) for one in motions)
    if not strokes or sum(s.at.stop - s.at.start for s in strokes) < COASTING * moving:
        return None
    ways = {np.sign(s.v[0]) for s in strokes}
    made = best(
        strokes, {"Fc": coulomb, "Fv": viscous}, {"constant": constant} if len(ways) > 1 else {}
    )
    if made is None or made["Fc"] <= 0 or made.unexplained > EXPLAINED:
        return None
    if made["Fv"] < -2 * made.error("Fv"):  # no friction: something else brakes
        return None
    values = _values(made, J, motion)
    many = f"{len(strokes)} coast-downs" if len(strokes) > 1 else "One coast-down"
    taken = f", with J = {J:.6g} {unit_for('kg m2', motion)} as declared" if J else ""
    alone = ALONE if len(ways) == 1 else ""
    return BenchTest(KIND, f"{many}{taken}: {in_words(values)}.{alone}", values)


def _values(made: Fitted, J: float | None, motion: str) -> dict[str, Estimate]:
    per = {"Fc/J": "m/s2" if motion == "linear" else "rad/s2", "Fv/J": "1/s"}
    found = {
        f"{k}/J": interval(made[k], made.error(k), made.freedom, per[f"{k}/J"])
        for k in ("Fc", "Fv")
    }
    if J:
        for k, unit in (("Fc", "N m"), ("Fv", "N m s/rad")):
            one = found[f"{k}/J"]
            low, high = one.ci95 or (0.0, 0.0)
            found[k] = Estimate(J * one.value, unit_for(unit, motion), (J * low, J * high))
    return found
