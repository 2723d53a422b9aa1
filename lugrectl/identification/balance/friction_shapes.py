"""Friction near rest: where the drive stands, and whether friction falls with speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .constants import CLEARLY, DIP_SPEEDS, FEWEST_CHANGES, RISE, SURE, TURN_DISTANCES
from .fit import Fit, fit, tried
from .terms import Term, bristle, dip, reversals
from .track import Track
from .windows import Source


def with_rest(tracks: Sequence[Track], limit: float) -> list[Track]:
    """The tracks with the direction before and after each rest, |w| < ``limit``."""
    return [_with_rest(track, limit) for track in tracks]


def _with_rest(track: Track, limit: float) -> Track:
    rests = np.abs(track.speed) < limit
    moving = np.flatnonzero(~rests)
    side = np.concatenate([[0.0], np.sign(track.speed[moving]), [0.0]])
    i = np.searchsorted(moving, np.arange(len(track)))
    return replace(track, stopping=rests * side[i], starting=rests * side[i + 1])


def with_turning(source: Source, made: Fit, speed: float) -> Fit:
    """Coulomb friction that turns over within a distance, where that is clearly more likely and
    there are reversals enough to see it."""
    if "Fc" not in made.names or reversals(source.tracks) < FEWEST_CHANGES:
        return made
    distances = speed * made.half_width * np.geomspace(*TURN_DISTANCES)
    shapes = [Term("Fc", bristle(x), friction=True) for x in distances.tolist()]
    plain, others = tried(source, made, shapes, made.names.index("Fc"))
    best = max(others, key=lambda f: f.score, default=plain)
    if best.score <= plain.score + CLEARLY:
        return made
    return fit(source, made.half_width, best.terms, made.setting, made.delay) or made


def dips(speed: float, lowest: float) -> dict[Term, float]:
    """Falls of friction with speed, each with its speed, at all speeds that a record may show."""
    speeds = np.geomspace(lowest, max(0.25 * speed, 1.01 * lowest), DIP_SPEEDS).tolist()
    return {Term("dip", dip(v, n), friction=True): v for v in speeds for n in (1, 2)}


def with_dip(source: Source, made: Fit, speed: float, lowest: float) -> tuple[Fit, list[Fit]]:
    """Friction that falls with speed (Stribeck), or is lower right at rest, where that is clearly
    more likely; and what may be right as well."""
    shapes = dips(speed, lowest)
    plain, others = tried(source, made, list(shapes))
    best = None
    for other in sorted(others, key=lambda f: -f.score):
        value, error = other.p[len(made.terms)], np.sqrt(np.diag(other.V)[len(made.terms)])
        at_rest = shapes[other.terms[-1]] < RISE * speed
        if abs(value) > SURE * error and (value > 0 or at_rest):
            best = other
            break
    if best is None or best.score <= plain.score + CLEARLY:
        return made, []
    taken = fit(source, made.half_width, best.terms, made.setting, made.delay)
    if taken is None:
        return made, []
    # no law has a negative dip: the fit without it counts as well
    return taken, [made] if taken.value("dip") < 0 else []
