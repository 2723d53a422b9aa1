"""The reference of the loops: a sine, one inside a record's range, or that of the user."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import InputError
from ..core.validation import array, shown
from ..record import Record

SAMPLES = 4000
LONGEST = 30.0  # s of simulated time
SLOWEST = 10.0  # s, longest period of the default reference
PERIODS, SETTLED = 1.25, 0.25  # of a sine: simulated, and left out of the error
FEWEST, MOST = 20, 50_000  # samples of them
USUAL = 0.8  # of a record's speed


@dataclass(frozen=True, eq=False)
class Course:
    """Times, position, speed and acceleration of the reference, and a summary of it."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    a: np.ndarray
    summary: dict[str, float] = field(default_factory=dict)

    def rows(self, kind: str) -> dict[str, np.ndarray]:
        """Return the reference r of a kind of loop and its derivatives, by name."""
        if kind == "velocity":
            return {"r": self.w, "dr": self.a}
        return {"r": self.theta, "dr": self.w, "ddr": self.a}


def sine(
    t: np.ndarray, speed: float, frequency: float, start: float = 0.0, phase: float = 0.0
) -> Course:
    """Return a sine of the speed (rad/s, Hz) that begins at a position and a phase."""
    turn = 2.0 * np.pi * frequency
    x = turn * t + phase
    theta = start + speed / turn * (np.cos(phase) - np.cos(x))
    return Course(t, theta, speed * np.sin(x), speed * turn * np.cos(x))


def samples(periods: float, frequency: float, rate: float) -> int:
    """Return the number of samples of so many periods."""
    return round(periods / frequency * rate) + 1


def enough_samples(frequency: float, rate: float, what: str) -> int:
    """Return the number of samples of a run; InputError where they are too few or too many."""
    n = samples(PERIODS, frequency, rate)
    if not FEWEST <= n <= MOST:
        raise InputError(
            f"{what} takes {n} samples, outside {FEWEST} to {MOST}: give another frequency."
        )
    return n


def course(
    given: tuple[ArrayLike, ArrayLike] | None,
    record: Record | None,
    kind: str,
    bandwidth: float,
    timed: bool,
) -> Course:
    """Return the reference; ``timed``: as long as the record, for effects that depend on time."""
    if given is not None:
        return _given(given, kind)
    speed, travel, centre, duration = _range(record)
    pulse = min(max(speed / travel, 2.0 * np.pi / SLOWEST), bandwidth / 5.0)
    travel = min(travel, speed / pulse)
    length = min(max(6.0 * np.pi / pulse, duration if timed else 0.0), LONGEST)
    frequency = pulse / (2.0 * np.pi)
    way = sine(np.linspace(0.0, length, SAMPLES + 1), travel * pulse, frequency, centre - travel)
    way.summary.update(peak_speed=travel * pulse, frequency=frequency, duration=length)
    return way


def _given(given: Any, kind: str) -> Course:
    if not isinstance(given, (list, tuple, np.ndarray)) or len(given) != 2:
        raise InputError(f"reference must be a pair of times and values, not {shown(given)}.")
    t, r = (array(x, f"reference: {what}") for x, what in zip(given, ("t", "r"), strict=True))
    if t.ndim != 1 or t.shape != r.shape or len(t) < 3 or not np.all(np.isfinite([t, r])):
        raise InputError("reference must be (t, r): at least 3 finite times and as many values.")
    if np.any(np.diff(t) <= 0.0):
        raise InputError("the times of the reference must increase.")
    first = np.gradient(r, t)
    moves = (np.zeros_like(r), r, first)
    if kind == "position":
        moves = r, first, np.gradient(first, t)
    summary = {"peak_speed": float(np.max(np.abs(moves[1]))), "duration": float(t[-1] - t[0])}
    return Course(t, *moves, summary)


def speed_of(record: Record) -> float:
    """Return the speed of the usual reference."""
    return _range(record)[0]


def top_speed(record: Record) -> float:
    """Return what the speed exceeds in a twentieth of the time, less a margin; 0 without motion."""
    w, theta = record.w, record.theta
    if w is None and theta is not None:
        n = max(1, round(0.02 / record.dt))
        w = (theta[n:] - theta[:-n]) / (n * record.dt)
    return 0.0 if w is None or not len(w) else USUAL * float(np.nanquantile(np.abs(w), 0.95))


def _range(record: Record | None) -> tuple[float, float, float, float]:
    """Return speed, half travel and centre, well inside the record's range, and its duration."""
    if record is not None:
        theta, speed = record.theta, top_speed(record)
        if theta is None:
            theta = np.cumsum(np.zeros(1) if record.w is None else record.w) * record.dt
        low, high = float(np.nanmin(theta)), float(np.nanmax(theta))
        if speed > 0.0 and high > low:
            return speed, 0.4 * (high - low), 0.5 * (low + high), record.samples * record.dt
    return 1.0, 1.0 / (0.5 * np.pi), 0.0, 0.0
