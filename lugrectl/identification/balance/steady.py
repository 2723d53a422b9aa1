"""Runs at steady speed: a map, whose runs are points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .constants import (
    FEWEST_SAMPLES,
    PARTS,
    PARTS_TURNING,
    SHARE_STEADY,
    STEADY,
    STEADY_WINDOW,
    TURN,
)
from .motion import Sensors, window_means
from .terms import Travel
from .track import Track


def steady(tracks: Sequence[Track], sensors: Sensors) -> list[Track] | None:
    """The tracks at steady speed, if they hold most of the samples; else None."""
    found = []
    for track in tracks:
        n = len(track)
        half = float(max(min(n // 8, int(STEADY_WINDOW / track.dt)), 4))
        late = int(abs(sensors.lag) / track.dt) + 1
        at = track.centres(int(half) + 2 + late + n // 20, int(half / 2))
        if len(at) < 3:
            continue
        m = window_means(track, half, at, sensors)
        low, middle, high = np.quantile(m.w, [0.1, 0.5, 0.9])
        found.append((track, high - low, abs(middle), m.noise_w))
    top = max((w for _, _, w, _ in found), default=0.0)
    still = [
        p for p, spread, w, s in found if spread < STEADY * w + 0.01 * top + 2 * s and w > 3 * s
    ]
    enough = sum(map(len, still)) > SHARE_STEADY * sum(map(len, tracks))
    return still if enough else None


def as_points(tracks: Sequence[Track]) -> list[Track]:
    """Each run with one speed and one direction, however its samples flicker or it starts."""
    return [replace(p, speed=np.full(len(p), np.median(p.speed[p.ok]))) for p in tracks]


def width_of_map(tracks: Sequence[Track], travel: Travel, speed: float, gravity: bool) -> float:
    """Half-width in s: as long as the runs, unless the angle changes along them."""
    parts = PARTS_TURNING if gravity else PARTS
    shortest = min(p.duration for p in tracks)
    dt = float(np.median([p.dt for p in tracks]))
    turning = TURN / speed if travel.span > 1 else np.inf
    return max(min(shortest / parts, turning), FEWEST_SAMPLES * dt)


def evenly(tracks: Sequence[Track], half_width: float) -> list[Track]:
    """A long run counts at most as twice the usual one."""
    counts = [max(3 * (p.duration - 2 * half_width) / half_width, 1.0) for p in tracks]
    return [replace(p, most=int(np.ceil(2 * np.median(counts)))) for p in tracks]
