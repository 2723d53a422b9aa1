"""One record as a simulation takes it: torque, what an observer corrects by, noise, windows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import coherence

from ...blocks.effects.actuator import held_late
from ...record import Record
from ...record.signal_noise import repeating, sensor_noise

SEGMENT = 256  # samples of one segment of a spectrum; a piece has four or tells nothing
BAND = (0.125, 0.25)  # of the rate: above most motion, below where rounding hides a speed
TOGETHER = 0.8  # median coherence there from which two channels share their noise
SLIDES, MOVES = 0.01, 0.1  # of the largest speed; of a window
REPEATED = (
    "w is the derivative of theta, as both have the same noise. States are estimated from theta "
    "alone; errors are computed on w."
)
Range = tuple[int, int]
Pair = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Windows:
    """Stretches of one run: ``start`` (n,) in samples, each ``length`` samples long."""

    start: np.ndarray
    length: int

    @classmethod
    def over(cls, ranges: list[Range] | tuple[Range, ...], gap: int, length: int) -> Windows:
        """Those that fit into ranges one after the other, after a gap in each."""
        starts = [np.arange(a + gap, b - length + 1, length) for a, b in ranges]
        return cls(np.concatenate([*starts, np.zeros(0, int)]), length)

    @property
    def counted(self) -> np.ndarray:
        """Their samples, (n, length)."""
        return self.start[:, None] + np.arange(self.length)

    @property
    def samples(self) -> int:
        return self.start.size * self.length

    def spread(self, share: float) -> Windows:
        """A share of them, evenly spread; at least one."""
        kept = min(self.start.size, max(1, round(share * self.start.size)))
        at = np.linspace(0, self.start.size - 1, kept).round().astype(int)
        return Windows(self.start[at], self.length)


@dataclass(frozen=True, eq=False)
class Run:
    """One record on its own even time; SI units, N samples.

    ``t, u, d`` (N,): time, torque, load torque (0 where not recorded), held from sample to sample.
    ``recorded`` (N, 2): theta and w, nan where not recorded; ``own`` is their sensors' noise.
    ``y`` (N, 2): the same as an observer corrects by it, with its ``noise``, larger where samples
    repeat each other, and the share of samples that are new, ``weight``. ``theta`` (N,): position,
    or the integral of w from 0. ``pieces``: ranges without a lost sample.
    """

    t: np.ndarray
    u: np.ndarray
    d: np.ndarray
    recorded: np.ndarray
    own: Pair
    y: np.ndarray
    noise: Pair
    weight: Pair
    theta: np.ndarray
    dt: float
    pieces: tuple[Range, ...]
    said: str = ""

    @cached_property
    def speed(self) -> np.ndarray:
        """The speed as recorded, or that of the next 10 ms of positions, (N,)."""
        if np.isfinite(self.own[1]):
            return self.recorded[:, 1]
        n = min(self.count(0.01), len(self.t) - 1)
        rise = (self.theta[n:] - self.theta[:-n]) / (n * self.dt)
        return np.append(rise, np.full(n, rise[-1]))

    def count(self, seconds: float, least: int = 1) -> int:
        """A time in samples."""
        return max(least, round(seconds / self.dt))

    def before(self, start: np.ndarray, most: int) -> np.ndarray:
        """How many of the ``most`` samples before each are in the same piece, (n,)."""
        begins = np.array([a for a, _ in self.pieces])
        return np.minimum(start - begins[np.searchsorted(begins, start, "right") - 1], most)

    def moving(self, where: Windows) -> Windows:
        """Those in which the drive moves, as a rest says nothing of what moves it; all of them
        where it never does."""
        w = np.abs(self.speed)
        moved = np.mean((w > SLIDES * w.max())[where.counted], axis=1) > MOVES
        return Windows(where.start[moved], where.length) if moved.any() else where

    def torque(self, offset: float, delay: float) -> np.ndarray:
        """u without an offset (N m), and so much later (s), earlier where below 0, (N,)."""
        u = self.u - offset
        turn = 1 if delay >= 0 else -1  # earlier is later in reversed time
        for a, b in self.pieces if delay else ():
            u[a:b] = held_late(u[a:b][::turn], self.dt, abs(delay))[::turn]
        return u


def run_of(record: Record) -> Run:
    """The record with its sensors' noise; a w that repeats theta corrects no observer: its noise
    is that of theta, coloured by a filter, and would look like a torque."""
    empty = np.full(record.samples, np.nan)
    recorded = np.column_stack([empty if c is None else c for c in (record.theta, record.w)])
    pieces = tuple((s.start, s.stop) for s in record.segments())
    steps = [record.resolution.get(role, 0.0) for role in ("theta", "w")]
    known = [x is not None for x in (record.theta, record.w)]
    own, often = np.full(2, np.nan), np.ones(2)
    for k in np.flatnonzero(known):
        own[k] = sensor_noise(recorded[:, k], steps[k])
        often[k] = repeating(recorded[:, k], steps[k])
    y, noise, said = recorded, own * np.sqrt(often), ""
    if all(known) and _together(recorded, pieces):
        y, noise, said = recorded * [1.0, np.nan], noise * [1.0, np.nan], REPEATED
    theta = record.theta
    if theta is None:
        theta = np.cumsum(recorded[:, 1]) * record.dt
    weight = np.where(np.isfinite(noise), 1.0 / often, 0.0)
    own, noise, weight = ((float(x[0]), float(x[1])) for x in (own, noise, weight))
    d = np.zeros(record.samples) if record.d is None else record.d
    dt = record.dt
    return Run(record.t, record.u, d, recorded, own, y, noise, weight, theta, dt, pieces, said)


def _together(y: np.ndarray, pieces: tuple[Range, ...]) -> bool:
    """True if theta and w are coherent above the frequencies of motion: they share their noise."""
    long = [y[a:b] for a, b in pieces if b - a >= 4 * SEGMENT]
    return bool(long) and all(map(_coherent, long))


def _coherent(y: np.ndarray) -> bool:
    f, both = coherence(np.diff(y[:, 0], 2), np.diff(y[1:, 1]), nperseg=SEGMENT)
    return float(np.median(both[(f > BAND[0]) & (f <= BAND[1])])) > TOGETHER
