"""What friction may do near rest: shapes that turn over, dip, or hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..dataset.measured_bristle import GONE, along
from .constants import DIPS, REST_TORQUE, TURNS
from .terms import Term
from .track import Track


@dataclass(frozen=True)
class Bristle:
    """Coulomb friction that turns over within a distance after a reversal (Dahl).

    As :func:`~lugrectl.identification.dataset.measured_bristle.along`; sign(w) for a distance of 0.
    """

    distance: float

    def __call__(self, track: Track) -> np.ndarray:
        if not self.distance:
            return np.sign(track.speed)
        return along(*track.strokes, self.distance)


@dataclass(frozen=True)
class Between:
    """The difference of two turning distances."""

    near: float
    far: float

    def __call__(self, track: Track) -> np.ndarray:
        return Bristle(self.far)(track) - Bristle(self.near)(track)


@dataclass(frozen=True)
class Dip:
    """sign(w) exp(-(|w|/speed)^power), power 1 or 2: friction that falls with speed (Stribeck)."""

    speed: float
    power: int

    def __call__(self, track: Track) -> np.ndarray:
        x = np.abs(track.speed / self.speed).astype(np.float32)  # six digits, in half the time
        x = np.minimum(x if self.power == 1 else x * x, GONE)
        return np.sign(track.speed) * np.exp(-x)


def stopping(track: Track) -> np.ndarray:
    """At rest, the direction of the motion before."""
    return track.stopping


def starting(track: Track) -> np.ndarray:
    """At rest, the direction of the motion after."""
    return track.starting


def shapes_near_rest(speed: float, half_width: float) -> list[Term]:
    """The terms that carry what the shape of friction near rest leaves open."""
    length = speed * half_width
    turns = [
        Term(f"turn {i}", Between(a * length, b * length), share, True)
        for i, ((a, b), share) in enumerate(TURNS)
    ]
    dips = [Term(f"near dip {v}", Dip(v * speed, 1), share, True) for v, share in DIPS]
    rest = [Term(c.__name__, c, REST_TORQUE, True) for c in (stopping, starting)]
    return [*turns, *dips, *rest]


def with_rest(tracks: Sequence[Track], limit: float) -> list[Track]:
    """The tracks with the direction before and after each rest, |w| < ``limit``."""
    return [_with_rest(track, limit) for track in tracks]


def _with_rest(track: Track, limit: float) -> Track:
    rests = np.abs(track.speed) < limit
    moving = np.flatnonzero(~rests)
    if not len(moving):
        none = np.zeros(len(track))
        return replace(track, stopping=none, starting=none)
    i = np.searchsorted(moving, np.arange(len(track)))
    before = np.sign(track.speed[moving[np.maximum(i - 1, 0)]]) * (i > 0)
    after = np.sign(track.speed[moving[np.minimum(i, len(moving) - 1)]]) * (i < len(moving))
    return replace(track, stopping=rests * before, starting=rests * after)
