"""One record as a simulation takes it: torque, what an observer corrects by, noise, windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import coherence

from ...blocks.effects.actuator import held_late
from ...record import Record
from ...record.record import smallest_step
from ...record.signal_noise import repeating, sensor_noise

GAP = 0.25  # s, between training and held-out samples
LEAD = 1.0  # s, at most, that an observer runs before a window
EXACT = 1e-9  # of a signal's range: noise of what has none
SEGMENT = 256  # samples of one segment of a spectrum; a piece has four or tells nothing
BAND = (0.125, 0.25)  # of the rate: above most motion, below where rounding hides a speed
TOGETHER = 0.8  # median coherence there from which two channels share their noise
SLIDES, MOVES = 0.01, 0.1  # of the largest speed; of a window
REPEATED = (
    "w is the derivative of theta, as both have the same noise. States are estimated from theta "
    "alone; errors are computed on w."
)
Range = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Windows:
    """Stretches of a run: ``start`` (n,) in samples, each ``length`` long; an observer may run over
    ``lead`` (n,) samples before."""

    start: np.ndarray
    length: int
    lead: np.ndarray

    @property
    def counted(self) -> np.ndarray:
        """Their samples, (n, length)."""
        return self.start[:, None] + np.arange(self.length)

    def at(self, which: np.ndarray) -> Windows:
        """Some of them."""
        return Windows(self.start[which], self.length, self.lead[which])


@dataclass(frozen=True, eq=False)
class Run:
    """One record on its own even time; SI units, N samples.

    ``t, u, d`` (N,): time, torque, load torque (0 where not recorded), held from sample to sample.
    ``recorded`` (N, 2): theta and w, nan where not recorded, with their sensors' noise ``own``.
    ``y`` (N, 2): the same as an observer corrects by it, with ``noise``, larger where samples
    usually repeat each other, ``weight`` (N, 2), less than 1 where they do so for longer, and the
    smallest steps ``counts`` (2,). ``theta`` (N,): position, or the integral of w from 0.
    ``pieces``: ranges without a lost sample.
    """

    t: np.ndarray
    u: np.ndarray
    d: np.ndarray
    recorded: np.ndarray
    own: tuple[float, ...]
    y: np.ndarray
    noise: tuple[float, ...]
    weight: np.ndarray
    counts: np.ndarray
    theta: np.ndarray
    dt: float
    pieces: tuple[Range, ...]
    said: str

    @cached_property
    def speed(self) -> np.ndarray:
        """The speed as recorded, or that of the next 10 ms of positions, (N,)."""
        if np.isfinite(self.own[1]):
            return self.recorded[:, 1]
        n = min(self.count(0.01), len(self.t) - 1)
        rise = (self.theta[n:] - self.theta[:-n]) / (n * self.dt)
        return np.append(rise, np.full(n, rise[-1]))

    @cached_property
    def usual(self) -> float:
        """The usual size of dw/dt over 20 ms, rad/s2."""
        n = min(self.count(0.02), len(self.t) // 3)
        return max(float(np.std(self.speed[n:] - self.speed[:-n])) / (n * self.dt), 1e-12)

    def count(self, seconds: float, least: int = 1) -> int:
        """A time in samples."""
        return max(least, round(seconds / self.dt))

    @property
    def gap(self) -> int:
        return self.count(GAP, 2)

    def windows(
        self, ranges: Sequence[Range], length: int, of: Sequence[Range] | None = None
    ) -> Windows:
        """Those that fit into ranges one after the other, behind a gap in each; observers may run
        over samples of the ranges ``of``, of their own by default."""
        each = [np.arange(a + self.gap, b - length + 1, length) for a, b in ranges]
        start = np.concatenate([*each, np.zeros(0, int)])
        begins = np.array([a for a, _ in (ranges if of is None else of)] or [0])
        since = start - begins[np.searchsorted(begins, start, "right") - 1]
        return Windows(start, length, np.minimum(since, self.count(LEAD)))

    def moving(self, where: Windows) -> Windows:
        """Those in motion, as a rest says nothing of what moves it; all where there is none."""
        w = np.abs(self.speed)
        moved = np.mean((w > SLIDES * w.max())[where.counted], axis=1) > MOVES
        return where.at(moved) if moved.any() else where

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
    recorded, dt = np.full((record.samples, 2), np.nan), record.dt
    weight, own, often, counts = np.ones_like(recorded), np.full(2, np.nan), np.ones(2), np.zeros(2)
    for k, (role, x) in enumerate((("theta", record.theta), ("w", record.w))):
        if x is not None:
            recorded[:, k], step = x, record.resolution.get(role, 0.0)
            own[k] = max(sensor_noise(x, step), EXACT * np.ptp(x))
            often[k] = repeating(x, step)
            counts[k] = max(step, smallest_step(x))
            weight[:, k] = np.minimum(1.0, often[k] / _repeats(x, counts[k]))
    pieces = tuple((s.start, s.stop) for s in record.segments())
    repeated = bool(np.isfinite(own).all()) and _together(recorded, pieces)
    left = np.array([1.0, np.nan if repeated else 1.0])
    noise = tuple((own * np.sqrt(often) * left).tolist())
    theta = np.cumsum(recorded[:, 1]) * dt if record.theta is None else record.theta
    d = np.zeros(record.samples) if record.d is None else record.d
    measured = recorded, tuple(own.tolist()), recorded * left, noise, weight, counts, theta
    return Run(record.t, record.u, d, *measured, dt, pieces, REPEATED if repeated else "")


def _repeats(x: np.ndarray, count: float) -> np.ndarray:
    """For each sample, how many in a row stay on the same count."""
    steps = np.round((x - x[0]) / count) if count > 0.0 else x
    lengths = np.diff(np.flatnonzero(np.diff(steps, prepend=np.nan, append=np.nan) != 0.0))
    return np.repeat(lengths, lengths)


def _together(y: np.ndarray, pieces: Sequence[Range]) -> bool:
    """True if theta and w are coherent above the frequencies of motion: they share their noise."""
    long = [y[a:b] for a, b in pieces if b - a >= 4 * SEGMENT]
    for part in long:
        f, both = coherence(np.diff(part[:, 0], 2), np.diff(part[1:, 1]), nperseg=SEGMENT)
        if np.median(both[(f > BAND[0]) & (f <= BAND[1])]) <= TOGETHER:
            return False
    return bool(long)
