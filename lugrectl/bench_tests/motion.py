"""The motion and the torque of one log as a bench test sees them: what rests, what moves, and the
pieces of the torque: held, rising in a ramp, or anything else."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..record import Log
from ..record.samples.rows import Stamped, runs
from ..record.samples.usable import usable
from ..record.signal_noise import quantum, white_noise
from .edge_times import angle_of

RARE = 0.01  # of the rows at either end, which tell no span: peaks of a loop
JUMP = 0.02  # of the span of u, from which a change within a row is a step
FLAT = 0.02  # of the span of u, by which a held torque may differ from its mean (RMS)
STRAIGHT = 0.02  # of its own height, by which a ramp may differ from a line (RMS)
CERTAIN = 5.0  # standard deviations of the noise of u, that are no step
MOST = 400  # bends: a torque with more is no bench test's
SHORTEST = 4  # rows of a piece


@dataclass(frozen=True)
class Piece:
    """Rows ``at``; the torque is ``level + slope (t - t0)``, with t0 that of the first row."""

    at: slice
    level: float
    slope: float
    held: bool
    ramp: bool


def pieces(t: np.ndarray, u: np.ndarray, step: float) -> list[Piece]:
    """The pieces of u between its steps and its bends."""
    span = float(np.ptp(np.quantile(u, (RARE, 1 - RARE)))) or float(np.ptp(u))
    if not span:
        return [Piece(slice(0, len(u)), float(u[0]), 0.0, True, False)]
    noise = 1.4826 * float(np.median(np.abs(np.diff(u)))) / np.sqrt(2)
    far = JUMP * span + CERTAIN * noise
    jumps = np.flatnonzero(np.abs(np.diff(u)) > far) + 1
    edges = [0, *jumps.tolist(), len(u)]
    left = [(a, b) for a, b in zip(edges, edges[1:], strict=False) if b - a >= SHORTEST][::-1]
    made, bends = [], 0
    while left:
        a, b = left.pop()
        bend = _bend(t[a:b], u[a:b], far + step) if bends < MOST else None
        if bend is None:
            made.append(_piece(t, u, slice(a, b), span, step + noise))
            continue
        bends += 1
        left += [(x, y) for x, y in ((a + bend, b), (a, a + bend)) if y - x >= SHORTEST]
    return made


def _bend(t: np.ndarray, u: np.ndarray, far: float) -> int | None:
    """The row farthest from the chord, if it is off (Douglas and Peucker, 1973)."""
    off = np.abs(u - u[0] - (u[-1] - u[0]) * (t - t[0]) / (t[-1] - t[0]))
    i = int(np.argmax(off))
    return i if off[i] > far and 0 < i < len(u) - 1 else None


def _piece(t: np.ndarray, u: np.ndarray, at: slice, span: float, step: float) -> Piece:
    t, u = t[at] - t[at.start], u[at]
    held = bool(np.std(u) < FLAT * span + step)
    slope, level = np.polyfit(t, u, 1)
    height = abs(slope) * t[-1]
    off = float(np.std(u - level - slope * t))
    ramp = height > 5 * FLAT * span and off < STRAIGHT * height + step
    if held and not ramp:
        return Piece(at, float(np.mean(u)), 0.0, True, False)
    return Piece(at, float(level), float(slope), False, bool(ramp))


FEWEST = 30  # rows of a test
WINDOWS = (3, 5, 9, 17, 33, 65, 129)  # rows over which a speed is a slope
SMOOTH = 0.01  # of the top speed, to which its noise is brought down
LEVELS = 12  # of u: of fewer no register is known
FEW = 16  # rows, for which a speed may stay the same before it is stale
CLEAR = 5.0  # standard deviations of the speed's noise from which the axis moves
SLOW = 0.01  # of the top speed below which the axis rests


@dataclass(frozen=True, eq=False)
class Motion:
    """Rows in time order. ``x`` is the angle, ``w`` the speed where no angle was recorded: x is
    then its integral; ``fresh`` marks the rows whose motion was measured anew; ``noise`` is the
    standard deviation of a sample of the signal that was recorded, ``step`` that of u."""

    t: np.ndarray
    u: np.ndarray
    x: np.ndarray
    w: np.ndarray | None
    fresh: np.ndarray
    noise: float
    step: float
    dt: float

    @property
    def angle(self) -> bool:
        """Whether the angle was measured."""
        return self.w is None

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def speeds(self) -> tuple[np.ndarray, float, int]:
        """The speed at every row, the standard deviation of its noise, and rows of its window."""
        found = self._slope(3) if self.w is None else (self.w, self.noise)
        window = 3 if self.w is None else 1
        for m in WINDOWS:
            if found[1] < SMOOTH * self._top(found[0]) or m > len(self) // 4:
                break
            found, window = (self._slope(m) if self.w is None else self._mean(m)), m
        return *found, window

    def _top(self, v: np.ndarray) -> float:
        return float(np.quantile(np.abs(v), 0.995))

    def _slope(self, m: int) -> tuple[np.ndarray, float]:
        """Slopes of x over m rows by least squares."""
        j = np.arange(m) - (m - 1) / 2
        k = j / (j @ j) / self.dt
        x = np.pad(self.x - self.x[0], m // 2, mode="reflect", reflect_type="odd")
        return np.convolve(x, k[::-1], "valid"), self.noise * float(np.linalg.norm(k))

    def _mean(self, m: int) -> tuple[np.ndarray, float]:
        assert self.w is not None
        w = np.pad(self.w, m // 2, mode="edge")
        return np.convolve(w, np.full(m, 1 / m), "valid"), self.noise / np.sqrt(m)

    @property
    def v(self) -> np.ndarray:
        return self.speeds[0]

    @property
    def window(self) -> int:
        """The rows over which the speed is smeared."""
        return self.speeds[2]

    @cached_property
    def top(self) -> float:
        return self._top(self.v)

    @cached_property
    def still(self) -> float:
        """The speed below which the axis rests."""
        return max(CLEAR * self.speeds[1], SLOW * self.top)

    @cached_property
    def side(self) -> np.ndarray:
        """The direction of the motion in each row, 0 at rest."""
        moving = (np.abs(self.v) > self.still) & ~self.stale
        return np.sign(self.v) * moving

    @cached_property
    def stale(self) -> np.ndarray:
        """Rows in which a speed without an angle was not renewed for long: a rest."""
        made = np.zeros(len(self), bool)
        for first, length in runs(~self.fresh) if not self.angle else ():
            made[first : first + length] = True
        return made

    @cached_property
    def pieces(self) -> list[Piece]:
        """The torque between its steps and its bends."""
        return pieces(self.t, self.u, self.step)

    @cached_property
    def strokes(self) -> list[slice]:
        """The motions in one direction."""
        edges = np.flatnonzero(np.diff(self.side, prepend=0.0, append=0.0))
        pairs = zip(edges[:-1], edges[1:], strict=True)
        return [slice(int(a), int(b)) for a, b in pairs if self.side[a]]


def motions(log: Log) -> list[Motion]:
    """The parts of a log, each on its own rows."""
    rows = usable(log)
    if "u" not in rows.channels or not {"theta", "w"} & set(rows.channels):
        return []
    made = [_motion(rows, part) for part in rows.parts()]
    return [one for one in made if one is not None]


def _motion(rows: Stamped, part: slice) -> Motion | None:
    needed = ("u", "theta" if "theta" in rows.channels else "w")
    taken = {k: rows.channels[k][part] for k in needed}
    good = np.all([np.isfinite(x) for x in (rows.t[part], *taken.values())], axis=0)
    t = rows.t[part][good]
    if len(t) < FEWEST or np.any(np.diff(t) <= 0):
        return None
    dt = float(np.median(np.diff(t)))
    values = {k: x[good] for k, x in taken.items()}
    u = values["u"]
    step = quantum(u) if len(np.unique(u)) > LEVELS else 0.0
    every = np.ones(len(t), bool)
    if "theta" in values:
        x = values["theta"]
        return Motion(t, u, x, None, every, white_noise([x]), step, dt)
    w = values["w"]
    counted = angle_of(t, w)
    if counted is not None:
        x, count = counted
        return Motion(t, u, x, None, every, count / np.sqrt(12), step, dt)
    fresh = _renewed(w)
    return Motion(t, u, _integral(t, w, fresh), w, fresh, white_noise([w]), step, dt)


def _renewed(w: np.ndarray) -> np.ndarray:
    """Rows of a new value; a value that stays for a few rows is new in each."""
    made = np.diff(w, prepend=np.nan) != 0
    for first, length in runs(~made):
        made[first : first + length] = length <= FEW
    return made


def _integral(t: np.ndarray, w: np.ndarray, renewed: np.ndarray) -> np.ndarray:
    """The angle that a speed passes, straight between the rows that renew it."""
    w = np.interp(t, t[renewed], w[renewed])
    return np.append(0.0, np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t)))
