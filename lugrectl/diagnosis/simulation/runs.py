"""One record as a simulation takes it: torque, what an observer corrects by, noise, windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import coherence, welch

from ...blocks.effects.actuator import held_late
from ...record import Record
from ...record.signal_noise import repeating, sensor_noise

SEGMENT = 256  # samples of one segment of a spectrum, at least four of them
BAND = (0.125, 0.25)  # of the rate: above most motion, below where rounding hides a speed
TOGETHER = 0.8  # median coherence there from which two channels share their noise
FAST, SLOWER = (0.35, 0.45), (0.15, 0.25)  # of the rate
RISING = 1.5  # ratio of a difference's noise in these bands is 2 to 3, that of a sensor 1
SLIDES, MOVES = 0.01, 0.1  # of the largest speed; of a window

REPEATED = (
    "w is the derivative of theta, as both have the same noise. The state is estimated from theta "
    "alone; errors are computed on w."
)
DIFFERENCED = (
    "By its noise, w is a difference of positions from sample to sample. The state is estimated "
    "from that position; errors are computed on w."
)


@dataclass(frozen=True, eq=False)
class Windows:
    """Stretches of one run that count: ``start`` (n,), in samples, each ``length`` long."""

    start: np.ndarray
    length: int

    @property
    def counted(self) -> np.ndarray:
        """Their samples, (n, length)."""
        return self.start[:, None] + np.arange(self.length)

    def spread(self, most: int) -> Windows:
        """At most so many of them, evenly spread."""
        if len(self.start) <= most:
            return self
        kept = np.linspace(0, len(self.start) - 1, most).round().astype(int)
        return Windows(self.start[kept], self.length)


@dataclass(frozen=True, eq=False)
class Run:
    """One record on its own even time.

    Attributes
    ----------
    t, u, d : ndarray (N,)
        Time in s, torque and load torque in N m (0 where not recorded), held from sample to sample.
    y : ndarray (N, 2)
        Position and speed by which an observer corrects, rad and rad/s; nan where not recorded.
    recorded : ndarray (N, 2)
        Position and speed as recorded; nan where not.
    theta : ndarray (N,)
        The position, or the integral of the speed from 0.
    dt : float
        Step in s.
    pieces : tuple of (int, int)
        Ranges without a lost sample.
    noise, weight : tuple of two floats
        Of y: standard deviation of the sensor's noise, larger where samples repeat each other, and
        the share of samples that are new.
    own : tuple of two floats
        Standard deviation of the noise of ``recorded``; nan where nothing was.
    said : str
        What was noticed; "" for nothing.
    """

    t: np.ndarray
    u: np.ndarray
    d: np.ndarray
    y: np.ndarray
    recorded: np.ndarray
    theta: np.ndarray
    dt: float
    pieces: tuple[tuple[int, int], ...]
    noise: tuple[float, float]
    weight: tuple[float, float]
    own: tuple[float, float]
    said: str = ""

    @property
    def seen(self) -> np.ndarray:
        """Which of theta and w correct the observer, as indices."""
        return np.flatnonzero(np.isfinite(self.noise))

    @property
    def weight_seen(self) -> np.ndarray:
        """The weights of theta and w, 0 where not recorded, (2,)."""
        return np.where(np.isfinite(self.noise), self.weight, 0.0)

    def samples(self, seconds: float, least: int = 1) -> int:
        """A time in samples."""
        return max(least, round(seconds / self.dt))

    def lead(self, start: np.ndarray, most: int) -> np.ndarray:
        """For each sample, how many of the ``most`` before it are in the same piece, (n,)."""
        begins = np.array([a for a, _ in self.pieces])
        return np.minimum(start - begins[np.searchsorted(begins, start, "right") - 1], most)

    def speed(self) -> np.ndarray:
        """The speed as recorded, or the difference of positions over 10 ms, (N,)."""
        if np.isfinite(self.own[1]):
            return self.recorded[:, 1]
        n = min(self.samples(0.01), len(self.t) - 1)
        rise = (self.theta[n:] - self.theta[:-n]) / (n * self.dt)
        return np.concatenate([rise, np.full(n, rise[-1])])

    def moving(self, where: Windows) -> Windows:
        """Those in which the drive moves: a rest says nothing of what moves it. All of them where
        it never does."""
        w = np.abs(self.speed())
        moved = np.mean((w > SLIDES * w.max())[where.counted], axis=1) > MOVES
        return Windows(where.start[moved], where.length) if moved.any() else where

    def torque(self, offset: float, delay: float) -> np.ndarray:
        """u with an offset (N m) taken off, and so much later, s, earlier where below 0, (N,)."""
        u = self.u - offset
        for a, b in self.pieces if delay else ():
            if delay > 0:
                u[a:b] = held_late(u[a:b], self.dt, delay)
            else:  # in reversed time
                u[a:b] = held_late(u[a:b][::-1], self.dt, -delay)[::-1]
        return u


def run_of(record: Record) -> Run:
    """The record with the noise of its sensors, and a w that is no sensor of its own left out of
    the observer: its noise is that of a position, coloured, and would look like a torque."""
    empty = np.full(record.samples, np.nan)
    recorded = np.column_stack([empty if c is None else c for c in (record.theta, record.w)])
    pieces = tuple((s.start, s.stop) for s in record.segments())
    steps = [record.resolution.get(role, 0.0) for role in ("theta", "w")]
    own = tuple(_noise(x, step) for x, step in zip(recorded.T, steps, strict=True))
    y, said = recorded.copy(), ""
    if record.w is not None and record.theta is None and _differenced(record.w, pieces):
        y, said = np.column_stack([np.cumsum(record.w) * record.dt, empty]), DIFFERENCED
        steps[0] = steps[0] or steps[1] * record.dt
    elif record.w is not None and record.theta is not None and _together(recorded, pieces):
        y[:, 1], said = np.nan, REPEATED
    often = [repeating(x, s) if np.isfinite(x).any() else 1.0 for x, s in zip(y.T, steps)]  # noqa: B905
    noise = [_noise(x, s) * np.sqrt(n) for x, s, n in zip(y.T, steps, often, strict=True)]
    if record.theta is not None:
        theta = record.theta
    else:
        assert record.w is not None
        theta = np.cumsum(record.w) * record.dt
    d = np.zeros(record.samples) if record.d is None else record.d
    return Run(
        record.t, record.u, d, y, recorded, theta, record.dt, pieces, (noise[0], noise[1]),
        (1.0 / often[0], 1.0 / often[1]), (own[0], own[1]), said,
    )  # fmt: skip


def _noise(x: np.ndarray, step: float) -> float:
    return sensor_noise(x, step) if np.isfinite(x).any() else np.nan


def _differenced(w: np.ndarray, pieces: tuple[tuple[int, int], ...]) -> bool:
    """True if the noise of w rises with frequency, as that of a difference does."""
    long = [w[a:b] for a, b in pieces if b - a >= 4 * SEGMENT]
    return bool(long) and all(map(_rises, long))


def _rises(w: np.ndarray) -> bool:
    f, power = welch(np.diff(w), nperseg=SEGMENT)
    power = power[1:] / np.sin(np.pi * f[1:]) ** 2
    fast, slower = (np.median(power[(f[1:] > a) & (f[1:] <= b)]) for a, b in (FAST, SLOWER))
    return bool(fast > RISING * slower)


def _together(y: np.ndarray, pieces: tuple[tuple[int, int], ...]) -> bool:
    """True if theta and w are coherent above the frequencies of motion: they share their noise."""
    long = [y[a:b] for a, b in pieces if b - a >= 4 * SEGMENT]
    return bool(long) and all(map(_coherent, long))


def _coherent(y: np.ndarray) -> bool:
    f, both = coherence(np.diff(y[:, 0], 2), np.diff(y[1:, 1]), nperseg=SEGMENT)
    return float(np.median(both[(f > BAND[0]) & (f <= BAND[1])])) > TOGETHER
