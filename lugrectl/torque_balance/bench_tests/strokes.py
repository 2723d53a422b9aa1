"""The motion and the torque of one log as a bench test sees them, and the one regression that all
bench tests share. Over strokes it is the balance of momentum, of which nothing is differentiated:

    x(t) = x0 + w0 t + (1/J) II u - (Fc/J) II sign(w) - (Fv/J) II w - ...      (II: twice over time)

where the angle was recorded, the same once integrated where only the speed was. It is linear in
1/J, Fc/J and Fv/J; x0 and w0 are free in each stroke.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import stats
from scipy.signal import correlate, savgol_coeffs, savgol_filter

from ...core.numeric import Z95, rms
from ...core.regression import spread
from ...estimates.findings import Estimate
from ...record import Log
from ...record.samples.rows import Stamped
from ...record.signal_noise import quantum, repeats, white_noise
from ...record.uniform_time import usable

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
            of = {"polyorder": int(self.angle), "deriv": int(self.angle), "delta": self.dt}
            v = savgol_filter(self.y, rows, **of)
            noise = self.noise * float(np.linalg.norm(savgol_coeffs(rows, **of)))
            if noise < SMOOTH * _top(v) or 4 * rows > len(self):
                break
        return v, noise, rows

    @property
    def v(self) -> np.ndarray:
        return self.speeds[0]

    @property
    def window(self) -> int:
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


# ---- the regression


CLEARLY = 4.0  # standard errors from which a further term is there
STROKES = 6  # from which on they are repetitions enough to tell an error
LEAST = 8  # fresh rows of a stroke
FAST = 0.1  # of the top speed of a stroke: slower, friction may be above its Coulomb level
SCALE = 1e-3  # relative error of any scale and clock, standard deviation
TINY = 1e-300
Values = Mapping[str, float]
Columns = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Fitted:
    """Coefficients by name, their covariance and its degrees of freedom; of rivals how likely each
    is, and its coefficients."""

    p: Values
    V: np.ndarray
    freedom: float
    left: float  # RMS of what is left
    moved: float  # RMS of what is fitted
    cost: float
    rows: float  # how many are independent
    rivals: Sequence[tuple[float, Values]] = field(default=())

    def of(self, what: Callable[[Values], float]) -> tuple[float, float]:
        """A function of the coefficients with its standard error, which holds what rivals say."""
        value, slopes = what(self.p), []
        for name, error in zip(self.p, np.sqrt(np.diag(self.V)), strict=False):
            step = 1e-3 * error + TINY
            ahead, behind = (what({**self.p, name: self.p[name] + s}) for s in (step, -step))
            slopes.append((ahead - behind) / (2 * step))
        apart = sum(share * (what(p) - value) ** 2 for share, p in self.rivals)
        return float(value), float(np.sqrt(np.maximum(slopes @ self.V @ slopes, 0.0) + apart))

    def clear(self, name: str) -> float:
        value, error = self.of(lambda p: p[name])
        return abs(value) / max(error, TINY)


def solved(
    columns: Columns,
    y: np.ndarray,
    taken: int = 0,
    ends: Sequence[int] = (),
    known: float = 1.0,
    white: bool = False,
) -> Fitted | None:
    """Fit y by columns; None where they cannot be separated. The covariance is of what is left,
    with its memory unless it is ``white``, at least of the variance ``known``, and of what differs
    between strokes, whose ``ends`` are these, if that is more. ``taken`` coefficients were taken
    off y and the columns."""
    A = np.column_stack([*columns.values()])
    size, free = np.linalg.norm(A, axis=0), len(y) - A.shape[1] - taken
    if free < 1 or not np.all(size) or not np.all(np.isfinite(A)):
        return None
    B = A / size
    H = B.T @ B
    if np.linalg.cond(H) > 1e12:
        return None
    H = np.linalg.inv(H)
    p = H @ (B.T @ y)
    r = y - B @ p
    cost, strokes = float(r @ r), len(ends) - 1
    rows = free if white else free / min(memory(r), free / 4 + 1)
    V, freedom = H * max(cost / free, known) * free / rows, rows
    if strokes >= STROKES:
        M = np.array([B[a:b].T @ r[a:b] for a, b in pairwise(ends)])
        apart = H @ (M.T @ M) @ H * strokes / (strokes - 1)
        more = np.sqrt(np.maximum(np.diag(apart) / np.diag(V), 1.0))
        V, freedom = V * np.outer(more, more), min(rows, strokes - 1.0)
    found = dict(zip(columns, (p / size).tolist(), strict=True))
    left = float(np.sqrt(cost / free))
    return Fitted(found, V / np.outer(size, size), freedom, left, rms(y), cost, rows)


def memory(r: np.ndarray) -> float:
    """The integral of the autocorrelation, in rows, up to its first zero."""
    c = correlate(r, r)[len(r) - 1 :]
    if c[0] <= 0:
        return 1.0
    end = int(np.argmax(c <= 0)) or len(c)
    return float(1 + 2 * np.sum(c[1:end]) / c[0])


def interval(value: float, error: float, freedom: float, unit: str, known: float = 0.0) -> Estimate:
    """A value with its 95 % interval: of its standard error, and of what is known of sensors."""
    student = float(stats.t.ppf(0.975, max(freedom, 1.0)))
    half = float(np.hypot(student * error, Z95 * np.hypot(known, SCALE * value)))
    return Estimate(float(value), unit, (float(value - half), float(value + half)))


# ---- strokes ---------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Stroke:
    """A motion without a rest; ``at`` are its rows, those of a swing are numbered."""

    motion: Motion
    at: slice
    swing: int = 0

    def __getattr__(self, name: str) -> np.ndarray:
        return getattr(self.motion, name)[self.at]

    def integral(self, rate: np.ndarray) -> np.ndarray:
        return np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(self.t)))


Impulse = Callable[[Stroke], np.ndarray]
IMPULSES: dict[str, Impulse] = {  # what each coefficient multiplies, integrated once
    "1/J": lambda s: np.append(0.0, np.cumsum(s.u[:-1] * np.diff(s.t))),
    "Fc": lambda s: -s.integral(np.sign(s.v)),
    "Fv": lambda s: s.x[0] - s.x,
    "constant": lambda s: s.t[0] - s.t,
    "late": lambda s: -s.u,  # acting later than it was logged, to first order
    "sin": lambda s: -s.integral(np.sin(s.x)),
    "cos": lambda s: -s.integral(np.cos(s.x)),
}


def stroked(one: Motion, at: slice) -> list[Stroke]:
    """A stroke without its slow ends, whose speed is smeared with the rest; none of few rows."""
    edge, v = one.window // 2 + 1, np.abs(one.v[at])
    fast = at.start + np.flatnonzero(v > FAST * v.max())
    first = max(int(fast[0]), at.start + edge * (at.start > 0))
    cut = slice(first, min(int(fast[-1]) + 1, at.stop - edge * (at.stop < len(one))))
    enough = cut.stop - cut.start >= LEAST and one.fresh[cut].sum() >= LEAST
    return [Stroke(one, cut)] if enough else []


class Table:
    """Columns of all strokes in units of the noise, with what is free in each taken off."""

    def __init__(self, strokes: Sequence[Stroke]) -> None:
        self.each = []
        for s in strokes:
            at = np.flatnonzero(s.fresh)
            t = s.t[at] - s.t[at[0]]
            powers = np.vander(t / t[-1], 2 if s.motion.angle else 1)
            self.each.append((s, at, np.linalg.qr(powers)[0]))
        self.ends = np.cumsum([0, *(len(at) for _, at, _ in self.each)]).tolist()
        self.y = self._column(lambda s: s.y - s.y[0])

    def of(self, impulse: Impulse) -> np.ndarray:
        return self._column(lambda s: s.integral(impulse(s)) if s.motion.angle else impulse(s))

    def _column(self, of: Impulse) -> np.ndarray:
        made = []
        for s, at, Q in self.each:
            x = of(s)[at]
            made.append((x - Q @ (Q.T @ x)) / s.motion.noise)
        return np.concatenate(made)

    def fit(self, columns: Columns) -> Fitted | None:
        return solved(columns, self.y, sum(Q.shape[1] for _, _, Q in self.each), self.ends)


def best(
    strokes: Sequence[Stroke], terms: Mapping[str, Impulse], more: Sequence[Sequence[str]] = ()
) -> Fitted | None:
    """The fit of the terms, with further ones that are clearly there."""
    table = Table(strokes)
    columns = {k: table.of(impulse) for k, impulse in terms.items()}
    made = table.fit(columns)
    if made is None:
        return None
    for added in more:
        tried = columns | {k: table.of(IMPULSES[k]) for k in added}
        other = table.fit(tried)
        if other is not None and max(map(other.clear, added)) > CLEARLY:
            made, columns = other, tried
    return made
