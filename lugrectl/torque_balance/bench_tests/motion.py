"""The motion and the torque of one log as a bench test sees them: what rests, what moves, and the
pieces of the torque: held, rising in a ramp, or anything else."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...core.regression import spread
from ...record import Log
from ...record.samples.rows import Stamped
from ...record.samples.usable import usable
from ...record.signal_noise import quantum, repeats, white_noise

RARE = 0.01  # of the rows at either end, which tell no span: peaks of a loop
JUMP = 0.02  # of the span of u, from which a change within a row is a step
FLAT = 0.02  # of the span of u, by which a held torque may differ from its mean (RMS)
STRAIGHT = 0.02  # of its own height, by which a ramp may differ from a line (RMS)
CERTAIN = 5.0  # standard deviations of noise, that are no step of u and no motion
MOST = 400  # bends: a torque with more is no bench test's
SHORTEST = 4  # rows of a piece
FEWEST = 30  # rows of a test
WINDOWS = (1, 3, 5, 9, 17, 33, 65, 129)  # rows over which a speed is a mean or a slope
SMOOTH = 0.01  # of the top speed, to which its noise is brought down
LEVELS = 12  # of u: of fewer no register is known
FEW = 16  # rows, for which a speed may stay the same before it is stale
SLOW = 0.01  # of the top speed below which the axis rests


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows ``at``; the torque is ``level + slope (t - t0)``, with t0 that of the first row."""

    at: slice
    level: float
    slope: float
    held: bool
    ramp: bool


@dataclass(frozen=True, eq=False)
class Motion:
    """Rows in time order of one part of a log."""

    t: np.ndarray
    u: np.ndarray
    x: np.ndarray  # the angle, or the integral of w
    y: np.ndarray  # what was measured: the angle or the speed
    angle: bool
    fresh: np.ndarray  # rows whose motion was measured anew
    noise: float  # standard deviation of a sample of y
    step: float  # that of u
    dt: float

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def speeds(self) -> tuple[np.ndarray, float, int]:
        """The speed at every row, the standard deviation of its noise, and rows of its window."""
        v, noise, rows = self.y, self.noise, 1
        for rows in WINDOWS[self.angle :]:
            j = np.arange(rows) - (rows - 1) / 2
            k = j / (j @ j) / self.dt if self.angle else np.full(rows, 1 / rows)
            y = np.pad(self.y, rows // 2, mode="reflect", reflect_type="odd")
            v, noise = np.convolve(y, k[::-1], "valid"), self.noise * float(np.linalg.norm(k))
            if noise < SMOOTH * _top(v) or 4 * rows > len(self):
                break
        return v, noise, rows

    @property
    def v(self) -> np.ndarray:
        return self.speeds[0]

    @property
    def window(self) -> int:
        """The rows over which the speed is smeared."""
        return self.speeds[2]

    @cached_property
    def still(self) -> float:
        """The speed below which the axis rests."""
        return max(CERTAIN * self.speeds[1], SLOW * _top(self.v))

    @cached_property
    def side(self) -> np.ndarray:
        """The direction of the motion in each row, 0 at rest and where it is not renewed."""
        return np.sign(self.v) * ((np.abs(self.v) > self.still) & self.fresh)

    @cached_property
    def strokes(self) -> list[slice]:
        """The motions in one direction."""
        edges = np.flatnonzero(np.diff(self.side, prepend=0.0, append=0.0)).tolist()
        return [slice(a, b) for a, b in pairwise(edges) if self.side[a]]

    @cached_property
    def pieces(self) -> list[Piece]:
        """The torque between its steps and its bends (Douglas and Peucker, 1973)."""
        t, u = self.t, self.u
        span = float(np.ptp(np.quantile(u, (RARE, 1 - RARE)))) or float(np.ptp(u))
        noise = spread(np.diff(u)) / np.sqrt(2)
        far = JUMP * span + CERTAIN * noise
        jumps = np.flatnonzero(np.abs(np.diff(u)) > far) + 1
        left = [ends for ends in pairwise([0, *jumps.tolist(), len(u)])][::-1]
        made, bends = [], 0
        while left:
            a, b = left.pop()
            if b - a < SHORTEST:
                continue
            chord = np.interp(t[a:b], t[[a, b - 1]], u[[a, b - 1]])
            bend = a + int(np.argmax(np.abs(u[a:b] - chord)))
            if bends < MOST and abs(u[bend] - chord[bend - a]) > far + self.step:
                bends += 1
                left += [(bend, b), (a, bend)]
            else:
                made.append(self._piece(slice(a, b), span, self.step + noise))
        return made

    def _piece(self, at: slice, span: float, step: float) -> Piece:
        t, u = self.t[at] - self.t[at.start], self.u[at]
        slope, level = np.polyfit(t, u, 1)
        height = abs(slope) * t[-1]
        straight = float(np.std(u - level - slope * t)) < STRAIGHT * height + step
        if straight and height > 5 * FLAT * span > 0:
            return Piece(at, float(level), float(slope), False, True)
        return Piece(at, float(np.mean(u)), 0.0, bool(np.std(u) <= FLAT * span + step), False)


def _top(v: np.ndarray) -> float:
    return float(np.quantile(np.abs(v), 0.995))


def motions(log: Log) -> list[Motion]:
    """The parts of a log, each on its own rows."""
    rows = usable(log)
    role = "theta" if "theta" in rows.channels else "w"
    if not {"u", role} <= set(rows.channels):
        return []
    made = [_motion(rows, part, role) for part in rows.parts()]
    return [one for one in made if one is not None]


def _motion(rows: Stamped, part: slice, role: str) -> Motion | None:
    t, u, y = rows.t[part], rows.channels["u"][part], rows.channels[role][part]
    good = np.isfinite(t) & np.isfinite(u) & np.isfinite(y)
    t, u, y = t[good], u[good], y[good]
    if len(t) < FEWEST or np.any(np.diff(t) <= 0):
        return None
    x, fresh = y, np.ones(len(t), bool)
    if role == "w":
        fresh = np.diff(y, prepend=np.nan) != 0
        fresh |= repeats(fresh) <= FEW  # a value that stays for a few rows is new in each
        w = np.interp(t, t[fresh], y[fresh])  # straight between the rows that renew it
        x = np.append(0.0, np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t)))
    dt, step = float(np.median(np.diff(t))), quantum(u) if len(np.unique(u)) > LEVELS else 0.0
    return Motion(t, u, x, y, role == "theta", fresh, white_noise([y]), step, dt)
