"""The recorded speed against the derivative of the position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...core.numeric import rms, top_speed
from .channel_noise import shared_noise, white_noise
from .constants import (
    GAIN,
    GROUPS,
    LAG,
    LAGS,
    LONGEST_SHARE,
    MAJORITY,
    NOTICED_GAIN,
    NOTICED_LAG,
    OFFSET,
    QUARTER,
    ROUNDS,
    SLOW,
    SMALL,
    SURE,
    WIDTHS,
)
from .motion import Sensors
from .regression import deviation, student
from .track import Track, means, weights


@dataclass(frozen=True, eq=False)
class Comparison:
    """w = gain dtheta/dt + offset, late by lag: the three values and their covariance."""

    values: np.ndarray
    covariance: np.ndarray


def sensors_of(tracks: Sequence[Track]) -> tuple[Sensors, Comparison | None, list[str]]:
    """The noise of every channel, w compared with dtheta/dt, and what is to be said.

    w(t) = gain (dtheta/dt (t - lag) + offset), by a robust fit over windows. What does not fit
    counts as noise of w, so that a worse w has little weight.
    """
    channels = [k for k in ("u", "theta", "w") if getattr(tracks[0], k) is not None]
    noise = {k: white_noise([getattr(p, k) for p in tracks], k == "u") for k in channels}
    sensors, found, spread = Sensors(noise), None, 0.0
    if "theta" not in noise or "w" not in noise:
        return sensors, None, []
    sensors = replace(sensors, lag=_likeliest(tracks))
    for _ in range(ROUNDS):
        rows = _rows(tracks, sensors.lag)
        if rows is None:
            return sensors, None, []
        c, V, spread = _robust(rows)
        if abs(c[0]) < SMALL:
            return replace(sensors, use_w=False), None, ["w is not dtheta/dt: it is left out."]
        lag = sensors.lag + float(c[1] / c[0])
        sensors = replace(sensors, gain=float(c[0]), offset=float(c[2] / c[0]), lag=lag)
        D = np.array([[1, 0, 0], [0, 0, 1], [-c[1] / c[0] ** 2, 1 / c[0], 0]])  # d(values)/dc
        found = Comparison(np.array([c[0], c[2], lag]), D @ V @ D.T)
    assert found is not None
    one = shared_noise([(p.theta, p.w) for p in tracks if p.theta is not None and p.w is not None])
    noise["w"] *= _excess(tracks[-1], sensors, spread)
    sensors = replace(sensors, noise=noise, one_source=one > MAJORITY)
    return sensors, found, _said(sensors, found)


def _rows(tracks: Sequence[Track], lag: float, most: float = 0.0) -> np.ndarray | None:
    """dtheta/dt, minus d2theta/dt2, 1, and w, as window means; the same windows for every lag up
    to ``most``."""
    rows = []
    for p in tracks:
        assert p.theta is not None and p.w is not None
        half, shift = max(WIDTHS[2] / p.dt, 6.0), lag / p.dt
        at = p.centres(int(half + max(abs(lag), most) / p.dt) + 2, int(half / 2))
        if not len(at):
            continue
        speed = means(p.theta, weights(half, 1), at) / p.dt
        late = -means(p.theta, weights(half, 2), at) / p.dt**2
        rows.append(np.c_[speed, late, np.ones(len(at)), means(p.w, weights(half, 0, shift), at)])
    return np.vstack(rows) if rows else None


def _likeliest(tracks: Sequence[Track]) -> float:
    """The lag to start from, by windows that all of those have which the runs are long enough for:
    a later one would leave out the starts, where it shows."""
    longest = LONGEST_SHARE * max(p.duration for p in tracks)
    lags = [lag for lag in LAGS if lag <= longest]
    return min(lags, key=lambda lag: _misfit(tracks, lag, lags[-1]))


def _misfit(tracks: Sequence[Track], lag: float, most: float) -> float:
    """What a speed so late leaves where the speed changes: at one speed no lag shows."""
    rows = _rows(tracks, lag, most)
    if rows is None:
        return np.inf
    change = np.abs(rows[:, 1])
    left = rows[:, 3] - rows[:, :3] @ _robust(rows)[0]
    return rms(left[change >= QUARTER * top_speed(change)])


def _robust(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Student-t fit of the rows: coefficients, covariance by blocks, and spread.

    Weak priors: at one constant speed gain and offset cannot be separated; then no offset.
    """
    D, y = rows[:, :3], rows[:, 3]
    size = np.sqrt(np.mean(D[:, 0] ** 2)) + 1e-12
    speeds = (D[:, 0], y)
    moves = np.any([np.abs(x) > SLOW * top_speed(x) for x in speeds], axis=0)  # rests are exact
    prior = np.diag(SMALL * size / np.array([GAIN, LAG, OFFSET * size]))
    r, c, s = y - D[:, 0], np.array([1.0, 0.0, 0.0]), 0.0
    weight = np.ones(len(y))
    for _ in range(5 * ROUNDS):
        s = deviation(r[moves]) + 1e-12 * size
        weight = student(r, s**2)
        A = np.r_[D * weight[:, None] ** 0.5, prior]
        b = np.r_[y * weight**0.5, prior @ [1, 0, 0]]
        c = np.linalg.lstsq(A, b, rcond=1e-10)[0]
        r = y - D @ c
    inverse = np.linalg.pinv(D.T @ (weight[:, None] * D) + prior.T @ prior)
    score = D * (weight * r)[:, None]
    sums = np.array([x.sum(0) for x in np.array_split(score, min(GROUPS, len(score)))])
    return c, inverse @ (sums.T @ sums + prior.T @ prior * s**2) @ inverse, s


def _excess(track: Track, sensors: Sensors, spread: float) -> float:
    """By how much w misses dtheta/dt beyond the noise of both."""
    half = max(WIDTHS[2] / track.dt, 6.0)
    own = sensors.noise["w"] * np.linalg.norm(weights(half, 0))
    other = sensors.noise["theta"] * np.linalg.norm(weights(half, 1)) / track.dt
    return max(1.0, float(spread / np.hypot(own, other)) / 1.3)


def _said(sensors: Sensors, found: Comparison) -> list[str]:
    """What w is beside dtheta/dt, where it is no chance."""
    said, least = [], SURE * np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    if abs(sensors.gain - 1) > NOTICED_GAIN:
        said.append(f"w is {sensors.gain:.4g} times dtheta/dt: the balance uses w divided by that.")
    if abs(sensors.lag) > max(NOTICED_LAG, least[2]):
        side = "behind" if sensors.lag > 0 else "ahead of"
        said.append(f"w is {abs(sensors.lag) * 1e3:.2f} ms {side} dtheta/dt: shifted by that time.")
    offset = sensors.gain * sensors.offset
    if abs(offset) > max(least[1], sensors.noise["w"]):
        side = "high" if offset > 0 else "low"
        said.append(f"w is {abs(offset):.3g} too {side} (beside dtheta/dt): it is subtracted.")
    return said
