"""Each run at a steady speed as one point of a map: its mean torque over its mean speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..blocks.block import unit_for
from ..core.errors import Refused
from ..core.option_names import option
from ..identification.dataset.dataset import Data, Log
from ..identification.dataset.kalman import Noise
from ..record import Record
from .path import CELLS, Path

LEAST_RUNS = 4
STEADY = 0.25  # of the mean speed, by which the parts of a run may differ
TURNS = 2.0  # least turns of a run for which the ripple over the angle is removed
ORDERS = 4  # of this ripple
ONE_SPEED = 0.1  # relative half-width about the median that holds all speeds


@dataclass(frozen=True)
class Points:
    """One value for each run: mean speed ``w``, mean torque ``u`` without a recorded load, and
    the standard ``error`` of this mean; ``samples`` and ``seconds`` over which it was taken; the
    ``path`` over the angle, None where theta was not recorded."""

    w: np.ndarray
    u: np.ndarray
    error: np.ndarray
    samples: np.ndarray
    seconds: np.ndarray
    path: np.ndarray

    @property
    def over_angle(self) -> bool:
        """Whether the torque may depend on the angles passed: after whole turns a mean does not."""
        return all(self.path) and not all(path.whole_turns for path in self.path)

    def rows(self, torque: np.ndarray) -> np.ndarray:
        """Means of torques (..., n) in the runs, from those at the points; from those along all
        paths the means, followed by the differences in the runs."""
        if not self.over_angle:
            return torque
        ends = np.cumsum([len(path.theta) for path in self.path])
        parts = zip(self.path, np.split(torque, ends[:-1], axis=-1), strict=True)
        made = np.stack([part @ path.rows.T for path, part in parts], axis=-1)
        return made.reshape(*torque.shape[:-1], -1)

    def only(self, which: np.ndarray) -> Points:
        return Points(*(values[which] for values in vars(self).values()))

    def beside(self, other: Points) -> Points:
        both = zip(vars(self).values(), vars(other).values(), strict=True)
        return Points(*map(np.concatenate, both))


def is_map(records: Sequence[Record]) -> bool:
    """True for runs at a steady speed each, which show friction but no inertia."""
    return len(records) >= LEAST_RUNS and all(map(is_steady, records))


def is_steady(record: Record) -> bool:
    """True if all parts of a run have about the same speed."""
    if record.samples < 2 * CELLS:
        return False
    means = np.array([np.mean(cell) for cell in np.array_split(speed(record), CELLS)])
    mean = float(np.mean(means))
    return bool(np.all(means * mean > 0.0) and np.std(means) < STEADY * abs(mean))


def speed(record: Record) -> np.ndarray:
    """w as recorded, or the slope of theta."""
    if record.w is not None:
        return record.w
    assert record.theta is not None
    return np.gradient(record.theta, record.dt)


def torque(record: Record) -> np.ndarray:
    """u without a recorded load: the torque of friction at a steady speed."""
    return record.u if record.d is None else record.u - record.d


def angle(record: Record) -> np.ndarray | None:
    """theta, up to a constant; None if time was lost and theta was not recorded."""
    if record.theta is not None:
        return record.theta
    return None if record.gaps else np.cumsum(speed(record)) * record.dt


def turns(record: Record) -> float:
    """Turns of a rotary drive in a run; 0 if they are unknown."""
    theta = angle(record)
    if theta is None or record.motion != "rotary":
        return 0.0
    return abs(float(theta[-1] - theta[0])) / (2.0 * np.pi)


def points(records: Sequence[Record]) -> Points:
    """The map of these runs.

    A ripple over the angle is fitted beside the mean, which an incomplete turn would shift. The
    error of the mean comes from the residual, by parts of the run.
    """
    rows = [_point(record) for record in records]
    *columns, paths = zip(*rows, strict=True)
    path = np.empty(len(rows), dtype=object)
    path[:] = paths
    w, u, error, samples, seconds = map(np.array, columns)
    return Points(w, u, error, samples, seconds, path)


def _point(record: Record) -> tuple[float, float, float, int, float, Path | None]:
    w = speed(record)
    u = torque(record)
    columns = [np.ones(record.samples)]
    theta = angle(record)
    if theta is not None and turns(record) >= TURNS:
        for order in range(1, ORDERS + 1):
            columns += [np.cos(order * theta), np.sin(order * theta)]
    A = np.column_stack(columns)
    x = np.linalg.lstsq(A, u, rcond=None)[0]
    means = [np.mean(cell) for cell in np.array_split(u - A @ x, CELLS)]
    error = float(np.std(means, ddof=1)) / np.sqrt(CELLS)
    # u is held over the step after its sample, and meets the angle in the middle of that
    held = None if record.theta is None else record.theta + 0.5 * record.dt * np.mean(w)
    path = None if held is None else Path.of(held, u, A)
    return float(np.mean(w)), float(x[0]), error, record.samples, record.duration, path


def laid(at: Points, motion: str) -> Data:
    """The points as independent samples, or the nodes of their paths over the angle; effects that
    depend on t cannot be seen."""
    w, u, run = at.w, at.u, np.arange(len(at.w), dtype=np.int16)
    count = np.arange(float(len(w)))
    if at.over_angle:
        many = [len(path.theta) for path in at.path]
        w, run, count = np.repeat(w, many), np.repeat(run, many), np.arange(float(sum(many)))
        u = np.concatenate([path.u for path in at.path])
    theta = np.concatenate([path.theta for path in at.path]) if at.over_angle else count
    zero, nan = np.zeros(len(w)), np.full(len(w), np.nan)
    log = Log(count, theta, w, zero, u, zero, 1.0, motion, ())
    noise = Noise(1.0, np.nan, 1.0)
    y = np.column_stack([nan, w])
    return Data(count, u, zero, y, 1.0, motion, (), noise, log, run)


def straight(at: Points, motion: str) -> tuple[float, float]:
    """Level and slope of the torque over speed, N m and N m s/rad, by least squares; beside a
    torque of once per turn, on a linear axis of a spring, where the runs pass different angles."""
    log = laid(at, motion).log
    columns = [np.sign(log.w), log.w]
    if at.over_angle:
        turning = [np.cos(log.theta), np.sin(log.theta)]
        columns += [log.theta] if motion == "linear" else turning
    A = np.column_stack([at.rows(x) for x in columns])
    level, slope = np.linalg.lstsq(A, at.rows(log.u), rcond=None)[0][:2]
    return float(level), float(slope)


def refuse_narrow(at: Points, motion: str, levels: bool, where: str) -> None:
    """Refuse a map of one direction or one speed, which does not identify friction.

    ``levels`` says whether the declared friction has a Coulomb level; ``where`` starts the
    sentence.

    Raises
    ------
    Refused
    """
    unit = unit_for("rad/s", motion)
    if levels and not (np.any(at.w > 0.0) and np.any(at.w < 0.0)):
        raise Refused(
            f"{where}: all of them go in one direction: Coulomb friction cannot be distinguished "
            "from a constant torque.",
            "Record the same speeds in the other direction, too.",
        )
    size = np.abs(at.w)
    if np.ptp(size) < 2.0 * ONE_SPEED * np.median(size):
        raise Refused(
            f"{where}: all of them go at one speed ({size.min():.3g} to {size.max():.3g} {unit}): "
            "how friction depends on speed cannot be identified.",
            "Record several speeds, from slow to fast, each twice as fast as the one before.",
        )
    level, slope = straight(at, motion)
    if float(level * size.sum() + slope * (size @ size)) <= 0.0:
        raise Refused(
            f"{where}: the torque opposes the motion that it should sustain.",
            f"Check the sign of u; {option('scale', 'u=-1')} reverses it.",
        )
