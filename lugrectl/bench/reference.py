"""The reference of the loops: given by the user, or a sine inside a record's range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import InputError
from ..core.validation import array, shown
from ..record import Record

SAMPLES = 4000
LONGEST = 30.0  # s of simulated time
SLOWEST = 10.0  # s, longest period of the default reference


@dataclass(frozen=True, eq=False)
class Course:
    """Times, position, speed and acceleration of the reference, and a summary of it."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    a: np.ndarray
    summary: dict[str, float]

    def followed(self, kind: str) -> np.ndarray:
        return self.w if kind == "velocity" else self.theta

    def inputs(self, kind: str) -> np.ndarray:
        """The inputs of a loop: r and its derivatives."""
        return np.vstack([self.w, self.a] if kind == "velocity" else [self.theta, self.w, self.a])


def course(
    given: tuple[ArrayLike, ArrayLike] | None,
    record: Record | None,
    kind: str,
    bandwidth: float,
    timed: bool,
) -> Course:
    """The reference; ``timed``: as long as the record, for effects that depend on time."""
    if given is not None:
        return _given(given, kind)
    speed, travel, centre, duration = _range(record)
    pulse = min(max(speed / travel, 2.0 * np.pi / SLOWEST), bandwidth / 5.0)
    travel = min(travel, speed / pulse)
    speed = travel * pulse
    length = min(max(6.0 * np.pi / pulse, duration if timed else 0.0), LONGEST)
    t = np.linspace(0.0, length, SAMPLES + 1)
    theta = centre - travel * np.cos(pulse * t)
    w, a = speed * np.sin(pulse * t), speed * pulse * np.cos(pulse * t)
    summary = {"peak_speed": speed, "frequency": pulse / (2.0 * np.pi), "duration": length}
    return Course(t, theta, w, a, summary)


def _given(given: tuple[ArrayLike, ArrayLike], kind: str) -> Course:
    if not isinstance(given, (list, tuple, np.ndarray)) or len(given) != 2:
        raise InputError(f"reference must be a pair of times and values, not {shown(given)}.")
    t, r = (array(x, f"reference: {what}") for x, what in zip(given, ("t", "r"), strict=True))
    if t.ndim != 1 or t.shape != r.shape or len(t) < 3 or not np.all(np.isfinite([t, r])):
        raise InputError("reference must be (t, r): at least 3 finite times and as many values.")
    if np.any(np.diff(t) <= 0.0):
        raise InputError("the times of the reference must increase.")
    first = np.gradient(r, t)
    w = r if kind == "velocity" else first
    a = first if kind == "velocity" else np.gradient(first, t)
    theta = np.zeros_like(r) if kind == "velocity" else r
    summary = {"peak_speed": float(np.max(np.abs(w))), "duration": float(t[-1] - t[0])}
    return Course(t, theta, w, a, summary)


def speed_of(record: Record) -> float:
    """Speed of the usual reference: 0.8 of what the record exceeds in a twentieth of its time."""
    return _range(record)[0]


def _range(record: Record | None) -> tuple[float, float, float, float]:
    """Speed, half travel and centre, well inside the record's range, and the record's duration."""
    if record is None:
        return 1.0, 1.0 / (0.5 * np.pi), 0.0, 0.0
    w, theta = record.w, record.theta
    if theta is None:
        theta = np.cumsum(np.zeros(1) if w is None else w) * record.dt
    if w is None:
        n = max(1, round(0.02 / record.dt))
        w = (theta[n:] - theta[:-n]) / (n * record.dt)
    speed = 0.8 * float(np.nanquantile(np.abs(w), 0.95))
    low, high = float(np.nanmin(theta)), float(np.nanmax(theta))
    if not (speed > 0.0 and high > low):
        return 1.0, 1.0 / (0.5 * np.pi), 0.0, 0.0
    return speed, 0.4 * (high - low), 0.5 * (low + high), record.samples * record.dt
