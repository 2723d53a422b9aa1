"""The rows of a log on their way to uniform time: what is left out, and what is said of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from ...core.unit_names import si_unit
from ..signal_noise import smallest_step

if TYPE_CHECKING:
    from ..log import Log

REQUIRED = ("u", "w", "theta")
HELD = ("u", "d", "r")  # channels held between samples; the others are interpolated
MOTION = ("theta", "w", "theta_load")  # smooth: linear interpolation errs by more than their noise
_APART = 0.5  # of the step; between closer stamps a spline would read noise as a slope


def count(number: int, noun: str) -> str:
    """Return '1 row', '3 rows'."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def bridged(x: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """Return the channel with straight lines over its bad samples."""
    if not bad.any() or bad.all():
        return x
    rows = np.arange(len(x))
    return np.interp(rows, rows[~bad], x[~bad])


def means_from(starts: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the mean of a channel (N,) from each start to the next; NaN without any number."""
    good = np.isfinite(x)
    with np.errstate(invalid="ignore"):
        total = np.add.reduceat(np.where(good, x, 0.0), starts)
        return total / np.add.reduceat(good.astype(float), starts)


@dataclass
class Stamped:
    """Rows with their stamps ``t`` (s); a bad or missing sample of a channel is NaN."""

    source: str
    motion: str
    t: np.ndarray
    channels: dict[str, np.ndarray]
    where: Callable[[int], str]
    labels: dict[str, str | None]
    rows: np.ndarray  # their places in the log
    new: np.ndarray  # the first row of each part that does not continue the one before
    dropped: int = 0
    said: list[str] = field(default_factory=list)
    steps: dict[str, float] = field(default_factory=dict)  # smallest recorded ones, by role

    @classmethod
    def of(cls, log: Log) -> Stamped:
        """Return all rows of a log."""
        finite = {
            role: np.where(np.isinf(x), np.nan, x) if np.isinf(x).any() else x
            for role, x in log.channels.items()
        }
        rows = np.arange(len(log.t))
        new = np.isin(rows, (0, *log.cuts))
        return cls(log.source, log.motion, log.t, finite, log.where, log.labels, rows, new)

    def copy(self) -> Stamped:
        """Return the same rows; a change of the copy leaves these as they are."""
        arrays = {k: getattr(self, k).copy() for k in ("t", "rows", "new")}
        channels = {role: x.copy() for role, x in self.channels.items()}
        said, steps = [*self.said], {**self.steps}
        return replace(self, **arrays, channels=channels, said=said, steps=steps)

    @property
    def required(self) -> list[str]:
        """The roles of torque and motion that the log has."""
        return [role for role in REQUIRED if role in self.channels]

    @property
    def motion_roles(self) -> list[str]:
        """The position first."""
        return [role for role in ("theta", "w") if role in self.channels]

    @property
    def motion_signal(self) -> np.ndarray:
        """The position where it was recorded, else the speed."""
        return self.channels[self.motion_roles[0]]

    def keep(self, mask: np.ndarray) -> None:
        """Leave out the other rows; a part begins at the first of its rows that is left."""
        part = np.cumsum(self.new)[mask]
        self.t, self.rows = self.t[mask], self.rows[mask]
        self.new = np.diff(part, prepend=part[0] - 1 if len(part) else 0) > 0
        self.channels = {role: values[mask] for role, values in self.channels.items()}

    def leave_out(self, role: str, bad: np.ndarray | slice, sentence: str) -> None:
        """Make the ``bad`` samples of a channel missing, and say it."""
        self.say(sentence)
        self.channels[role] = self.channels[role].copy()
        self.channels[role][bad] = np.nan

    def place(self, row: int) -> str:
        """Return 'line 2102' or 'row 2100' of one of these rows."""
        return self.where(int(self.rows[row]))

    def places(self, mask: np.ndarray) -> str:
        """Return 'in 3 rows, first at line 2102' of the rows in a mask."""
        rows = count(int(np.count_nonzero(mask)), "row")
        return f"in {rows}, first at {self.place(int(mask.argmax()))}"

    def value(self, role: str, row: int) -> str:
        """Return the value of a channel in one of these rows with its unit."""
        return f"{self.channels[role][row]:.6g} {si_unit(role, self.motion)}".rstrip()

    def say(self, *sentences: str) -> None:
        self.said += sentences

    def parts(self) -> list[slice]:
        """Return the rows of each part."""
        edges = [*np.flatnonzero(self.new), len(self.t)]
        return [slice(int(a), int(b)) for a, b in zip(edges, edges[1:], strict=False)]


def smallest_steps(channels: dict[str, np.ndarray]) -> dict[str, float]:
    """Return the smallest steps of the motion; without theta, that of the summed w as its."""
    motion = {r: x for r, x in channels.items() if r in MOTION}
    if "theta" not in motion and "w" in motion:
        motion["theta"] = np.cumsum(np.nan_to_num(motion["w"], posinf=0.0, neginf=0.0))
    return {r: smallest_step(x) for r, x in motion.items()}


# ---- resampling -------------------------------------------------------------------


def how(role: str) -> str:
    """How the missing samples of a channel are filled in."""
    return "held" if role in HELD else "interpolated"


def between(role: str, at: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Interpolate; before the first and after the last point the value is constant."""
    if role not in MOTION or len(at) < 2:
        return np.interp(grid, at, values)
    steps = np.diff(at)
    apart = np.r_[True, steps > _APART * np.median(steps)]
    return np.asarray(CubicSpline(at[apart], values[apart])(np.clip(grid, at[0], at[-1])))


def on_grid(
    role: str, at: np.ndarray, values: np.ndarray, grid: np.ndarray, dt: float
) -> np.ndarray:
    """Return a channel on a grid of step dt: a held one with its time integral."""
    if role in HELD:
        return held_mean(at, values, grid, dt)
    return between(role, at, values, grid)


def held_mean(stamps: np.ndarray, values: np.ndarray, grid: np.ndarray, dt: float) -> np.ndarray:
    """Mean of the held signal over each step; this keeps its time integral."""
    ends = np.r_[stamps, max(stamps[-1], grid[-1]) + 2 * dt]
    integral = np.r_[0.0, np.cumsum(values * np.diff(ends))]
    return (np.interp(grid + dt, ends, integral) - np.interp(grid, ends, integral)) / dt
