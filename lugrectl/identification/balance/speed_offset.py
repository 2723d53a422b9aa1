"""The offset of a speed that was logged alone: friction turns over where the motion stands still.

u = ... + Fc sign(w - w0) + Fv (w - w0),    w0 by Gauss and Newton
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .constants import (
    CLEARLY,
    MOST_OFFSET,
    OFFSETS,
    RARE,
    ROUNDS,
    SLIDING,
    SLOW,
    SURE,
    WHOLLY,
)
from .estimate import first_fit
from .fit import Fit, fit, tried
from .friction_shapes import with_rest
from .motion import with_speed
from .problem import Ground
from .regression import densities
from .terms import Column, Term
from .track import Track
from .windows import Source

KEY = "w_offset"


def shifted(offset: float) -> Column:
    """sign(w - offset)."""
    return lambda track: np.sign(track.speed - offset)


def slope(Fc: float, Fv: float, step: float) -> Column:
    """Derivative of Fc sign(w - w0) + Fv (w - w0) with w0, by a difference over ``step``."""

    def column(track: Track) -> np.ndarray:
        ends = np.sign(track.speed - step) - np.sign(track.speed + step)
        return Fc * ends / (2 * step) - Fv

    return column


def with_offset(ground: Ground) -> Ground:
    """The record with an offset of w as a term, where that is clearly more likely than none."""
    if ground.is_map or ground.tracks[0].theta is not None:
        return ground
    plain = first_fit(ground)
    if plain is None or not {"J", "Fc"} <= {*plain.names} or _stands(plain):
        return ground
    start = _likely(ground, plain)
    found, made = _refined(ground, plain, start)
    if made is None or _gain(made, plain) < CLEARLY:
        return ground
    return found


def _stands(made: Fit) -> bool:
    """Whether the drive is seen to stand where w is 0: then w has no offset."""
    d = made.windows
    a = np.abs(d.X[:, made.names.index("J")])
    still = (d.rest > WHOLLY) & (a <= 2 * d.noise_a)
    return bool(np.count_nonzero(still) > RARE * len(still))


def _gain(made: Fit, plain: Fit) -> float:
    """By how much the first fit is more likely, over the windows in which the drive moves.

    Windows at rest have an open torque: a fit without rest is not more likely for that.
    """
    one, other = (
        {k: i for i, k in enumerate(zip(f.windows.piece, f.windows.t, strict=True))}
        for f in (made, plain)
    )
    both = [k for k in one if k in other]
    i, j = [one[k] for k in both], [other[k] for k in both]
    moves = np.maximum(made.windows.rest[i], plain.windows.rest[j]) < SLIDING
    gain = (densities(made.solution)[i] - densities(plain.solution)[j])[moves]
    J, before = (abs(f.value("J", 1.0)) + 1e-300 for f in (made, plain))
    return float(np.sum(gain) + len(gain) * np.log(J / before))


def _likely(ground: Ground, plain: Fit) -> float:
    """The most likely offset of a coarse grid, on the windows of one width."""
    offsets = ground.speed * np.linspace(-MOST_OFFSET, MOST_OFFSET, OFFSETS)
    shapes = {Term("Fc", shifted(x), friction=True): x for x in offsets.tolist()}
    place = plain.names.index("Fc")
    _, others = tried(ground.source, plain, list(shapes), place)
    best = max(others, key=lambda f: f.score, default=plain)
    return shapes[best.terms[place]] if best.score > plain.score else 0.0


def _refined(ground: Ground, plain: Fit, offset: float) -> tuple[Ground, Fit | None]:
    """Gauss and Newton from an offset: the record about it, and its fit."""
    levels, found, made = plain, ground, None
    for _ in range(2 * ROUNDS):
        found = _about(ground, offset, levels)
        made = fit(found.source, plain.half_width, found.terms, found.setting, plain.delay)
        if made is None:
            return ground, None
        i = made.names.index(KEY)
        if abs(made.p[i]) < RARE * np.sqrt(made.V[i, i]):
            break
        most = MOST_OFFSET * ground.speed / OFFSETS  # half a step of the grid
        offset += float(np.clip(made.p[i], -most, most))
        levels = made
    return found, made


def _about(ground: Ground, offset: float, levels: Fit) -> Ground:
    """The record with its speed taken from ``offset`` on, and what remains of it as a term."""
    sensors = replace(ground.sensors, offset=offset)
    tracks, speed, noise = with_speed(ground.tracks, sensors)
    rest = max(SURE * noise, SLOW * speed)
    tracks = with_rest(tracks, rest)
    term = Term(KEY, slope(levels.value("Fc"), levels.value("Fv"), rest))
    return replace(
        ground,
        source=Source(tracks, sensors, ground.source.held),
        terms=(*ground.terms, term),
        setting=replace(ground.setting, rest=rest),
        speed=speed,
    )
