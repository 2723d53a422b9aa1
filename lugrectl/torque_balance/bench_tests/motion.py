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
from ...record.signal_noise import quantum, repeats, white_noise
from ...record.uniform_time import usable

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
    """The pieces of u between its steps and its bends (Douglas and Peucker, 1973)."""
    span = float(np.ptp(np.quantile(u, (RARE, 1 - RARE)))) or float(np.ptp(u))
    if not span:
        return [Piece(slice(0, len(u)), float(u[0]), 0.0, True, False)]
    noise = spread(np.diff(u)) / np.sqrt(2)
    far = JUMP * span + CERTAIN * noise
    jumps = np.flatnonzero(np.abs(np.diff(u)) > far) + 1
    edges = [0, *jumps.tolist(), len(u)]
    left = [(a, b) for a, b in pairwise(edges) if b - a >= SHORTEST][::-1]
    made, bends = [], 0
    while left:
        a, b = left.pop()
        since = (t[a:b] - t[a]) / (t[b - 1] - t[a])
        off = np.abs(u[a:b] - u[a] - (u[b - 1] - u[a]) * since)  # the chord
        bend = int(np.argmax(off))
        if bends >= MOST or off[bend] <= far + step or not 0 < bend < b - a - 1:
            made.append(_piece(t, u, slice(a, b), span, step + noise))
            continue
        bends += 1
        left += [(x, y) for x, y in ((a + bend, b), (a, a + bend)) if y - x >= SHORTEST]
    return made


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
    """Rows in time order of one part of a log."""

    t: np.ndarray
    u: np.ndarray
    x: np.ndarray  # the angle, or the integral of w
    w: np.ndarray | None  # the speed where no angle was recorded
    fresh: np.ndarray  # rows whose motion was measured anew
    noise: float  # standard deviation of a sample of the signal that was recorded
    step: float  # that of u
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
        found = self._smoothed(3 if self.angle else 1)
        for m in WINDOWS:
            if found[1] < SMOOTH * _top(found[0]) or m > len(self) // 4:
                break
            found = self._smoothed(m)
        return found

    def _smoothed(self, m: int) -> tuple[np.ndarray, float, int]:
        """Slopes of x over m rows by least squares, or means of w."""
        if self.w is not None:
            w = np.pad(self.w, m // 2, mode="edge")
            return np.convolve(w, np.full(m, 1 / m), "valid"), self.noise / np.sqrt(m), m
        j = np.arange(m) - (m - 1) / 2
        k = j / (j @ j) / self.dt
        x = np.pad(self.x - self.x[0], m // 2, mode="reflect", reflect_type="odd")
        return np.convolve(x, k[::-1], "valid"), self.noise * float(np.linalg.norm(k)), m

    @property
    def v(self) -> np.ndarray:
        return self.speeds[0]

    @property
    def window(self) -> int:
        """The rows over which the speed is smeared."""
        return self.speeds[2]

    @cached_property
    def top(self) -> float:
        return _top(self.v)

    @cached_property
    def still(self) -> float:
        """The speed below which the axis rests."""
        return max(CLEAR * self.speeds[1], SLOW * self.top)

    @cached_property
    def side(self) -> np.ndarray:
        """The direction of the motion in each row, 0 at rest."""
        return np.sign(self.v) * ((np.abs(self.v) > self.still) & ~self.stale)

    @cached_property
    def stale(self) -> np.ndarray:
        """Rows in which a speed without an angle was not renewed for long: a rest."""
        return np.zeros(len(self), bool) if self.angle else ~self.fresh

    @cached_property
    def pieces(self) -> list[Piece]:
        """The torque between its steps and its bends."""
        return pieces(self.t, self.u, self.step)

    @cached_property
    def strokes(self) -> list[slice]:
        """The motions in one direction."""
        edges = np.flatnonzero(np.diff(self.side, prepend=0.0, append=0.0)).tolist()
        return [slice(a, b) for a, b in pairwise(edges) if self.side[a]]


def _top(v: np.ndarray) -> float:
    return float(np.quantile(np.abs(v), 0.995))


def motions(log: Log) -> list[Motion]:
    """The parts of a log, each on its own rows."""
    rows = usable(log)
    if "u" not in rows.channels or not {"theta", "w"} & set(rows.channels):
        return []
    made = [_motion(rows, part) for part in rows.parts()]
    return [one for one in made if one is not None]


def _motion(rows: Stamped, part: slice) -> Motion | None:
    role = "theta" if "theta" in rows.channels else "w"
    t, u, x = rows.t[part], rows.channels["u"][part], rows.channels[role][part]
    good = np.isfinite(t) & np.isfinite(u) & np.isfinite(x)
    t, u, x = t[good], u[good], x[good]
    if len(t) < FEWEST or np.any(np.diff(t) <= 0):
        return None
    dt = float(np.median(np.diff(t)))
    step = quantum(u) if len(np.unique(u)) > LEVELS else 0.0
    every = np.ones(len(t), bool)
    if role == "theta":
        return Motion(t, u, x, None, every, white_noise([x]), step, dt)
    counted = angle_of(t, x)
    if counted is not None:
        angle, count = counted
        return Motion(t, u, angle, None, every, count / np.sqrt(12), step, dt)
    fresh = np.diff(x, prepend=np.nan) != 0
    fresh |= repeats(fresh) <= FEW  # a value that stays for a few rows is new in each
    w = np.interp(t, t[fresh], x[fresh])  # straight between the rows that renew it
    passed = np.append(0.0, np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t)))
    return Motion(t, u, passed, x, fresh, white_noise([x]), step, dt)


# ---- the angle behind a speed that is counts over the time since the last encoder edge: it
# keeps its value while no edge comes; times that time it is a whole number of counts


WHOLE = 0.03  # of a count, by which a whole number may be missed
MOSTLY = 0.95  # of the edges that must be whole numbers
EDGES, APART = 20, 3  # edges, and those more than a row apart
SPAN, EVEN = 64, 0.4  # rows, and counts RMS off a smooth angle in them (evenly rounded: 0.29)
OFTEN = 0.01  # of the rows, that a speed of whole counts per row takes


def angle_of(t: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, float] | None:
    """The angle at every row and its count; None where the speed is of another kind."""
    at = np.flatnonzero(np.diff(w, prepend=0.0) != 0)
    if len(at) < EDGES:
        return None
    dt = float(np.median(np.diff(t)))
    since = np.diff(np.round((t[at] - t[0]) / dt), prepend=0.0)  # rows
    passed = np.abs(w[at]) * since * dt
    late = passed[(since > 1) & (passed > 0)]
    tried = [float(np.quantile(late, 0.02))] if len(late) > EDGES else []
    values, many = np.unique(np.round(np.abs(w), 6), return_counts=True)
    often = values[(many > OFTEN * len(w)) & (values > 0)]  # their least difference: one per row
    usual = float(np.diff(often, prepend=0.0).min()) * dt if len(often) else 0.0
    for count in (*tried, quantum(np.abs(w)) * dt, *(usual * n for n in range(1, 5))):
        x = _angle(w, at, since, dt, count) if count else None
        if x is not None:
            return x, count
    return None


def _angle(
    w: np.ndarray, at: np.ndarray, since: np.ndarray, dt: float, count: float
) -> np.ndarray | None:
    """The angle, with this count; None where what passes is no whole number of it. Between two
    changes of w lie edges at the old speed, equally far apart, and one at the new."""
    rate = np.abs(w[at]) * dt / count  # counts per row
    own = _rows_of(rate, since)
    repeats = np.append(0.0, own[:-1])
    rest = since - own
    with np.errstate(all="ignore"):
        going = (rest > 0) & (repeats > 0) & (np.mod(rest, repeats) == 0)
    own = np.where(going, own, since)
    if np.mean(_is_whole(rate * own)) < MOSTLY:
        return None
    slow = (own > 1) & (rate > 0)  # one count after many rows: a mere register would not do that
    if np.sum(slow) < APART:
        # counts of an encoder add up to a smooth angle, the rounded values of a register drift
        x = np.cumsum(w) * dt / count
        parts = x[: len(x) // SPAN * SPAN].reshape(-1, SPAN)
        Q = np.linalg.qr(np.vander(np.arange(SPAN) / SPAN, 3))[0]
        left = np.sqrt(np.mean((parts - parts @ Q @ Q.T) ** 2, axis=1))
        moved = np.ptp(np.diff(parts, axis=1), axis=1) > 0.5
        if moved.sum() <= EDGES or np.median(left[moved]) >= EVEN:
            return None
    elif np.median(rate[slow] * own[slow]) > 1.5:
        return None
    steps = np.zeros(len(w))
    steps[at] = w[at] * own * dt
    for i in np.flatnonzero(going):
        edges = np.arange(at[i - 1] + repeats[i], at[i] - own[i] + 1, repeats[i]).astype(int)
        steps[edges] = w[at[i - 1]] * repeats[i] * dt
    return np.cumsum(steps)


def _rows_of(rate: np.ndarray, since: np.ndarray) -> np.ndarray:
    """The rows from one edge to the next at a rate: one from a count per row on."""
    with np.errstate(all="ignore"):
        rows = np.where(rate > 0, np.round(1 / rate), 0.0)
        slow = (rows > 1) & (np.abs(rows * rate - 1) < WHOLE / 10)
    fast = (rate > 0.5) & _is_whole(rate)
    return np.minimum(np.where(fast, 1.0, np.where(slow, rows, since)), since)


def _is_whole(x: np.ndarray) -> np.ndarray:
    return np.abs(x - np.round(x)) < WHOLE
