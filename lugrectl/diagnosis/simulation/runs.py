"""One record as a simulation takes it: torque, what an observer corrects by, noise, windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ...blocks.effects.actuator import held_late
from ...record import Record
from ...record.record import smallest_step
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


@dataclass(frozen=True, eq=False)
class Windows:
    """Stretches of one run: ``start`` (n,) in samples, each ``length`` samples long."""

    start: np.ndarray
    length: int

    @property
    def counted(self) -> np.ndarray:
        """Their samples, (n, length)."""
        return self.start[:, None] + np.arange(self.length)

    def spread(self, share: float) -> Windows:
        """A share of them, evenly spread; at least one."""
        kept = min(self.start.size, max(1, round(share * self.start.size)))
        at = np.linspace(0, self.start.size - 1, kept).round().astype(int)
        return Windows(self.start[at], self.length)


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
    said: str = ""

    @property
    def rounding(self) -> tuple[np.ndarray, np.ndarray]:
        """What an observer leaves of a correction by a repeated count, (N, 2), up to half a count:
        it may be one and the same rounding. A larger deviation is real."""
        return 1.0 - self.weight, 0.5 * self.counts

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

    def windows(self, ranges: Sequence[Range], gap: int, length: int) -> Windows:
        """Those that fit into ranges one after the other, after a gap in each."""
        starts = [np.arange(a + gap, b - length + 1, length) for a, b in ranges]
        return Windows(np.concatenate([*starts, np.zeros(0, int)]), length)

    def before(self, start: np.ndarray, most: int) -> np.ndarray:
        """How many of the ``most`` samples before each are in the same piece, (n,)."""
        begins = np.array([a for a, _ in self.pieces])
        return np.minimum(start - begins[np.searchsorted(begins, start, "right") - 1], most)

    def moving(self, where: Windows) -> Windows:
        """Those in motion, as a rest says nothing of what moves it; all where there is none."""
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
    recorded = np.full((record.samples, 2), np.nan)
    weight, own, often, counts = np.ones_like(recorded), np.full(2, np.nan), np.ones(2), np.zeros(2)
    for k, (role, x) in enumerate((("theta", record.theta), ("w", record.w))):
        if x is not None:
            recorded[:, k], step = x, record.resolution.get(role, 0.0)
            own[k], often[k] = sensor_noise(x, step), repeating(x, step)
            counts[k] = max(step, smallest_step(x))
            weight[:, k] = np.minimum(1.0, often[k] / _repeats(x, counts[k]))
    pieces = tuple((s.start, s.stop) for s in record.segments())
    repeated = bool(np.isfinite(own).all()) and _together(recorded, pieces)
    left = np.array([1.0, np.nan if repeated else 1.0])
    noise, dt = own * np.sqrt(often) * left, record.dt
    theta = np.cumsum(recorded[:, 1]) * dt if record.theta is None else record.theta
    d = np.zeros(record.samples) if record.d is None else record.d
    said = REPEATED if repeated else ""
    return Run(
        record.t, record.u, d, recorded, tuple(own.tolist()), recorded * left,
        tuple(noise.tolist()), weight, counts, theta, dt, pieces, said,
    )  # fmt: skip


def _repeats(x: np.ndarray, count: float) -> np.ndarray:
    """For each sample, how many in a row stay on the same count."""
    steps = np.round((x - x[0]) / count) if count > 0.0 else x
    lengths = np.diff(np.flatnonzero(np.diff(steps, prepend=np.nan, append=np.nan) != 0.0))
    return np.repeat(lengths, lengths)


def _together(y: np.ndarray, pieces: Sequence[Range]) -> bool:
    """True if theta and w are coherent above the frequencies of motion: they share their noise."""
    long = [y[a:b] for a, b in pieces if b - a >= 4 * SEGMENT]
    for part in long:
        both = _coherence(np.diff(part[:, 0], 2), np.diff(part[1:, 1]))
        f = np.arange(len(both)) / SEGMENT
        if np.median(both[(f > BAND[0]) & (f <= BAND[1])]) <= TOGETHER:
            return False
    return bool(long)


def _coherence(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The coherence of two signals by Welch's method, in segments that overlap by half."""
    window = 1.0 - np.cos(2 * np.pi * np.arange(SEGMENT) / SEGMENT)
    parts = [sliding_window_view(one, SEGMENT)[:: SEGMENT // 2] for one in (x, y)]
    a, b = (np.fft.rfft((p - p.mean(axis=1, keepdims=True)) * window) for p in parts)
    each = [np.mean(np.abs(one) ** 2, axis=0) for one in (a, b)]
    return np.abs(np.mean(a.conj() * b, axis=0)) ** 2 / (each[0] * each[1])
