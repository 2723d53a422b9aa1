"""Speed and acceleration as window means of both motion signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...core.numeric import top_speed
from .constants import CLEAN, SMOOTHINGS, TOP
from .track import Track, means, weights


@dataclass(frozen=True)
class Sensors:
    """Noise per sample of u, theta and w, and how w compares with dtheta/dt.

    w = gain (dtheta/dt + offset), late by ``lag`` seconds. ``one_source``: w was computed from
    the same encoder, so that the noise of both is one noise.
    """

    noise: dict[str, float]
    use_w: bool = True
    gain: float = 1.0
    offset: float = 0.0
    lag: float = 0.0
    one_source: bool = False


@dataclass(frozen=True, eq=False)
class Means:
    """Window means of speed and acceleration, with the standard deviation of their noise."""

    w: np.ndarray
    a: np.ndarray
    noise_w: float
    noise_a: float


def window_means(track: Track, half_width: float, at: np.ndarray, sensors: Sensors) -> Means:
    """Means of w and a around the samples ``at``; ``half_width`` in samples.

    Both signals count with the inverse of their variance, so that a worse one has little weight.
    Where both have one source, only the better one counts.
    """
    made = []
    if track.theta is not None:
        k = weights(half_width, 1) / track.dt, weights(half_width, 2) / track.dt**2
        made.append((track.theta, k, sensors.noise["theta"], 0.0))
    if track.w is not None and sensors.use_w:
        lag = sensors.lag / track.dt
        k = weights(half_width, 0, lag), weights(half_width, 1, lag) / track.dt
        k = k[0] / sensors.gain, k[1] / sensors.gain
        made.append((track.w, k, sensors.noise["w"], sensors.offset))
    w, noise_w = _weighed(
        [(means(x, k[0], at) - off, noise * _norm(k[0])) for x, k, noise, off in made],
        sensors.one_source,
    )
    a, noise_a = _weighed(
        [(means(x, k[1], at), noise * _norm(k[1])) for x, k, noise, _ in made], sensors.one_source
    )
    return Means(w, a, noise_w, noise_a)


def _weighed(estimates: list[tuple[np.ndarray, float]], best_only: bool) -> tuple:
    """The mean of estimates by inverse variance, and its standard deviation."""
    if best_only or len(estimates) == 1:
        return min(estimates, key=lambda e: e[1])
    inverse = np.array([e[1] ** -2.0 for e in estimates])
    mean = sum(c * e[0] for c, e in zip(inverse, estimates, strict=True)) / inverse.sum()
    return mean, float(inverse.sum() ** -0.5)


def _norm(k: np.ndarray) -> float:
    return float(np.linalg.norm(k))


def with_speed(tracks: Sequence[Track], sensors: Sensors) -> tuple[list[Track], float, float]:
    """The tracks with their speed at every sample, the top speed, and the noise of the speed.

    For terms that are not linear in the motion. The narrowest window whose noise is small counts.
    """
    made, top, noise = list(tracks), 0.0, 0.0
    for width in SMOOTHINGS:
        made, speeds, noise = [], [], 0.0
        for track in tracks:
            speed, own = _speed(track, width, sensors)
            made.append(replace(track, speed=speed, still=2 * own))
            speeds.append(speed[track.ok])
            noise = max(noise, own)
        top = top_speed(np.concatenate(speeds), TOP)
        if noise < CLEAN * top:
            break
    return made, top, noise


def _speed(track: Track, width: int, sensors: Sensors) -> tuple[np.ndarray, float]:
    n = len(track)
    half = float(min(width, max((n - 10) // 3, 2)))
    edge = int(half) + 3 + int(abs(sensors.lag) / track.dt)
    at = np.arange(edge, n - edge)
    if len(at) < 2:
        rough = track.w if track.theta is None else np.gradient(track.theta) / track.dt
        assert rough is not None
        return rough, 0.0
    found = window_means(track, half, at, sensors)
    return np.interp(np.arange(n), at, found.w), found.noise_w
