"""The runs of a log as spectra: torque, speed, reference; and the motion that friction follows.

The torque u[k] is held from sample k to k + 1. The speed is the derivative of the recorded
position, jw Theta(jw), so that no difference quotient delays it; without a position it is the
recorded speed. Friction of the interval from k to k + 1 belongs to u[k].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.fft import irfft, prev_fast_len, rfft, rfftfreq

from ..blocks.bristle_laws import strokes
from ..record import Record
from ..record.record import smallest_step

SMOOTH = 0.34  # of the sampling rate: where the motion that friction follows is down to 1/e
FINER = 4  # parts of an interval: the axis may reverse within it
REST_SAMPLES = 1  # before and after, within one count: the axis stands


@dataclass(frozen=True, eq=False)
class Run:
    """One stretch without a gap; spectra (M,) at ``w`` (M,) in rad/s from n samples.

    ``steps`` (FINER n,) is the smoothed motion of each part of an interval, rad or m.
    ``E`` is the spectrum of the changes of the reference, None where none was logged; ``load`` (n,)
    the measured load torque, 0 without one.
    """

    dt: float
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray
    count: float
    w: np.ndarray
    W: np.ndarray
    E: np.ndarray | None
    load: np.ndarray
    steps: np.ndarray

    @cached_property
    def U(self) -> np.ndarray:
        return self.spectrum(self.u)

    @cached_property
    def strokes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return strokes(self.steps)

    def spectrum(self, x: np.ndarray) -> np.ndarray:
        """The spectrum of signals (n,) or (n, m)."""
        return np.asarray(rfft(x, axis=0))

    def signal(self, X: np.ndarray) -> np.ndarray:
        """The signals (n,) or (n, m) of spectra."""
        return np.asarray(irfft(X, len(self.u), axis=0))

    @cached_property
    def fine_speed(self) -> np.ndarray:
        """The speed (FINER n,) in each part of an interval."""
        return self.steps * (FINER / self.dt)

    @cached_property
    def speed(self) -> np.ndarray:
        """The mean speed (n,) in each interval."""
        return means(self.fine_speed)

    @cached_property
    def stands(self) -> np.ndarray:
        """Whether the axis stands in an interval (n,): friction is then what the torque leaves."""
        if not self.count:
            return np.zeros(len(self.u), bool)
        near = np.pad(self.theta, REST_SAMPLES, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(near, 2 * REST_SAMPLES + 1)
        still = np.ptp(windows, axis=1) <= 1.01 * self.count
        return np.append(still[1:], still[-1])


def means(x: np.ndarray) -> np.ndarray:
    """The means (n,) over intervals of what is given in their parts."""
    return x.reshape(-1, FINER).mean(axis=1)


def runs_of(records: Sequence[Record]) -> list[Run]:
    """Every stretch of the records that is long enough to stand beside the longest."""
    pieces = [(r, part) for r in records for part in r.segments()]
    longest = max(part.stop - part.start for _, part in pieces)
    kept = [(r, part) for r, part in pieces if 4 * (part.stop - part.start) >= longest]
    logged = all(r.r is not None and np.ptp(r.r[part]) > 0 for r, part in kept)
    return [_run(r, part, logged) for r, part in kept]


def _run(record: Record, part: slice, logged: bool) -> Run:
    fast = prev_fast_len(part.stop - part.start, real=True) or 0  # zeros in its place would not do:
    part = slice(part.start, part.start + int(fast))  # the transients would not be smooth
    dt, u = record.dt, record.u[part]
    w = 2.0 * np.pi * np.asarray(rfftfreq(len(u), dt))
    if record.theta is not None:
        theta, count = record.theta[part], smallest_step(record.theta)
        W = np.asarray(rfft(np.diff(theta, prepend=theta[0]) / dt))
        late = 1j * w * dt
        W[1:] *= late[1:] / -np.expm1(-late[1:])  # from the difference quotient to the derivative
    else:
        speed: Any = record.w
        speed = speed[part]
        theta, count = dt * np.append(0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]))), 0.0
        W = np.asarray(rfft(speed))
    E, reference = None, record.r
    if logged and reference is not None:
        E = np.asarray(rfft(np.diff(reference[part], append=reference[part.stop - 1])))
    load = np.zeros(len(u)) if record.d is None else record.d[part]
    return Run(dt, record.t[part], u, theta, count, w, W, E, load, _motion(theta, count))


def _motion(theta: np.ndarray, count: float) -> np.ndarray:
    """The motion of each part of an interval, smoothed without a shift in time.

    Half a count of play is taken out: a resting axis does not chatter.
    """
    n = len(theta)
    line = np.linspace(theta[0], theta[-1], n)
    about = theta - line
    spectrum: Any = rfft(np.concatenate([about, -about[::-1]]))
    spectrum = spectrum * np.exp(-((np.asarray(rfftfreq(2 * n)) / SMOOTH) ** 2))
    smooth = FINER * np.asarray(irfft(spectrum, 2 * n * FINER))[: n * FINER]
    smooth += theta[0] + (theta[-1] - theta[0]) / (n - 1) * np.arange(n * FINER) / FINER
    steps = np.diff(_without_play(smooth, 0.5 * count), append=smooth[-1])
    steps[-FINER:] = 0.0  # beyond the last sample
    return steps


def _without_play(x: np.ndarray, half: float) -> np.ndarray:
    """The position behind a play of ``half`` to either side."""
    if not half:
        return x
    made, c = [], float(x[0])
    for one in x.tolist():
        c = one - half if one > c + half else one + half if one < c - half else c
        made.append(c)
    return np.array(made)
