"""Runs at steady speed: a map, whose runs are points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .constants import (
    FEWEST_SAMPLES,
    LITTLE,
    MOST,
    PARTS_OF_RUN,
    PARTS_TURNING,
    RARE,
    STEADY_WINDOW,
    TURN,
)
from .motion import Sensors, window_means
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
        p for p, spread, w, s in found if spread < LITTLE * w + RARE * top + 2 * s and w > 3 * s
    ]
    return still if sum(map(len, still)) > MOST * sum(map(len, tracks)) else None


def as_points(tracks: Sequence[Track]) -> list[Track]:
    """Each run with one speed and one direction, however its samples flicker or it starts."""
    return [replace(p, speed=np.full(len(p), np.median(p.speed[p.ok]))) for p in tracks]


def evenly(
    tracks: Sequence[Track], span: float, speed: float, gravity: bool
) -> tuple[list[Track], float]:
    """The tracks, of which a long run counts at most as twice the usual one, and the half-width in
    s: as long as the runs, unless the angle, of which they see ``span``, changes along them."""
    parts = PARTS_TURNING if gravity else PARTS_OF_RUN
    dt = float(np.median([p.dt for p in tracks]))
    longest = min(p.duration for p in tracks) / parts
    half = max(min(longest, TURN / speed if span > 1 else np.inf), FEWEST_SAMPLES * dt)
    usual = np.median([max(3 * (p.duration - 2 * half) / half, 1.0) for p in tracks])
    return [replace(p, most=int(np.ceil(2 * usual))) for p in tracks], half
