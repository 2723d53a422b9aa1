"""Speed and acceleration as window means of both motion signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .constants import SLOW, SMOOTHINGS, TOP
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
    estimates = []
    if track.theta is not None:
        estimates.append(_of_theta(track, half_width, at, sensors.noise["theta"]))
    if track.w is not None and sensors.use_w:
        estimates.append(_of_w(track, half_width, at, sensors))
    w, noise_w = _weighed([(e.w, e.noise_w) for e in estimates], sensors.one_source)
    a, noise_a = _weighed([(e.a, e.noise_a) for e in estimates], sensors.one_source)
    return Means(w, a, noise_w, noise_a)


def _of_theta(track: Track, half_width: float, at: np.ndarray, noise: float) -> Means:
    assert track.theta is not None
    k1 = weights(half_width, 1) / track.dt
    k2 = weights(half_width, 2) / track.dt**2
    w, a = (means(track.theta, k, at) for k in (k1, k2))
    return Means(w, a, noise * _norm(k1), noise * _norm(k2))


def _of_w(track: Track, half_width: float, at: np.ndarray, sensors: Sensors) -> Means:
    assert track.w is not None
    lag = sensors.lag / track.dt
    k0 = weights(half_width, 0, lag) / sensors.gain
    k1 = weights(half_width, 1, lag) / track.dt / sensors.gain
    w, a = means(track.w, k0, at) - sensors.offset, means(track.w, k1, at)
    noise = sensors.noise["w"]
    return Means(w, a, noise * _norm(k0), noise * _norm(k1))


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
            speeds.append(np.abs(speed[track.ok]))
            noise = max(noise, own)
        top = float(np.quantile(np.concatenate(speeds), TOP))
        if noise < SLOW * top:
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
