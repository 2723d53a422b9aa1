"""The balance of momentum, integrated over strokes: no signal is differentiated.

    x(t) = x0 + w0 t + (1/J) II u - (Fc/J) II sign(w) - (Fv/J) II w - ...      (II: twice over time)

where the angle was recorded, the same once integrated where only the speed was. It is linear in
1/J, Fc/J and Fv/J; x0 and w0 are free in each stroke.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from ...blocks.friction import level
from ...core.numeric import Z95, rms
from ...estimates.findings import Estimate
from .motion import Motion

FALLS = 10  # speeds at which friction may fall to its Coulomb level
MOST_FALL = 0.3  # of the top speed, up to which friction may fall
CLEARLY = 4.0  # standard errors from which a further term is there
STROKES = 6  # from which on they are repetitions enough to tell an error
SHORTEST = 8  # fresh rows of a stroke
EXPLAINED = 0.01  # of the motion, beyond the noise, that may be left of a test


@dataclass(frozen=True, eq=False)
class Stroke:
    """A motion without a rest; ``at`` are its rows, angles count from ``x0``."""

    motion: Motion
    at: slice
    x0: float = 0.0

    def once(self, rate: np.ndarray) -> np.ndarray:
        """The integral of a rate over the stroke, by the trapezoidal rule."""
        dt = np.diff(self.motion.t[self.at])
        return np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * dt))

    def integral(self, rate: np.ndarray) -> np.ndarray:
        """The integral of a torque along the motion, once or twice."""
        made = self.once(rate)
        return self.once(made) if self.motion.angle else made

    def driven(self) -> np.ndarray:
        """The integral of the torque, held from row to row, once or twice."""
        u, dt = self.u[:-1], np.diff(self.motion.t[self.at])
        once = np.append(0.0, np.cumsum(u * dt))
        if not self.motion.angle:
            return once
        return np.append(0.0, np.cumsum(once[:-1] * dt + 0.5 * u * dt**2))

    @property
    def u(self) -> np.ndarray:
        return self.motion.u[self.at]

    @property
    def v(self) -> np.ndarray:
        return self.motion.v[self.at]

    @property
    def x(self) -> np.ndarray:
        return self.motion.x[self.at]

    def measured(self) -> np.ndarray:
        return self.x if self.motion.w is None else self.motion.w[self.at]


Column = Callable[[Stroke], np.ndarray]
LAWS: dict[str, Column] = {  # what each coefficient multiplies
    "1/J": lambda s: s.driven(),
    "Fc": lambda s: -s.integral(np.sign(s.v)),
    "Fv": lambda s: -(s.once(s.x - s.x[0]) if s.motion.angle else s.x - s.x[0]),
    "constant": lambda s: -s.integral(np.ones(len(s.v))),
    # by how much a torque acts later than it was logged, to first order
    "late": lambda s: -(s.once(s.u) if s.motion.angle else s.u),
    "sin": lambda s: -s.integral(np.sin(s.x - s.x0)),
    "cos": lambda s: -s.integral(np.cos(s.x - s.x0)),
}


def fall(vs: float) -> Column:
    """Friction above its Coulomb level near rest (Stribeck)."""
    return lambda s: -s.integral(np.sign(s.v) * level(s.v, 0.0, 1.0, vs))


@dataclass(frozen=True, eq=False)
class Fitted:
    """Coefficients by name, their covariance and its degrees of freedom."""

    names: tuple[str, ...]
    p: np.ndarray
    V: np.ndarray
    freedom: float
    left: float  # RMS of what is left, over the noise of a sample
    cost: float  # sum of its squares
    moved: float  # RMS of what is fitted
    rows: float  # how many are independent

    def __getitem__(self, name: str) -> float:
        return float(self.p[self.names.index(name)])

    def error(self, name: str) -> float:
        i = self.names.index(name)
        return float(np.sqrt(max(self.V[i, i], 0.0)))

    def clear(self, name: str) -> float:
        """A coefficient in standard errors."""
        return abs(self[name]) / max(self.error(name), 1e-300)

    @property
    def unexplained(self) -> float:
        """What is left beyond the noise, as a share of the motion."""
        return max(self.left - 1, 0.0) / self.moved

    def ratio(self, name: str, to: str) -> tuple[float, float]:
        """A quotient of coefficients with its standard error."""
        i, j = self.names.index(name), self.names.index(to)
        value = self.p[i] / self.p[j]
        g = np.zeros(len(self.p))
        g[i], g[j] = 1 / self.p[j], -value / self.p[j]
        return float(value), float(np.sqrt(max(g @ self.V @ g, 0.0)))


def stroked(one: Motion, at: slice) -> Stroke | None:
    """A stroke without its ends, whose speed is smeared with the rest; None of too few rows."""
    edge = one.window // 2 + 1
    lead = edge if at.start else 0
    cut = slice(at.start + lead, at.stop - (edge if at.stop < len(one) else 0))
    if cut.stop - cut.start < SHORTEST or one.fresh[cut].sum() < SHORTEST:
        return None
    return Stroke(one, cut)


@dataclass(frozen=True, eq=False)
class Solved:
    """Least squares: values ``p`` with what is left, ``r``."""

    p: np.ndarray
    H: np.ndarray  # covariance of the values for a residual of unit variance
    r: np.ndarray
    free: int  # rows beyond the number of values

    @property
    def cost(self) -> float:
        return float(self.r @ self.r)

    @property
    def rows(self) -> float:
        """How many rows are independent: those of a residual with a memory are fewer."""
        return self.free / min(memory(self.r), self.free / 8)

    @property
    def V(self) -> np.ndarray:
        """The covariance of the values by what is left, with its memory."""
        return self.H * self.cost / self.rows


def solved(A: np.ndarray, y: np.ndarray) -> Solved:
    """Fit y by the columns of A; those that cannot be separated share what they explain."""
    H = np.linalg.pinv(A.T @ A)
    p = H @ (A.T @ y)
    return Solved(p, H, y - A @ p, max(len(y) - A.shape[1], 1))


class Table:
    """The columns of all strokes with what is free in each stroke taken off."""

    def __init__(self, strokes: Sequence[Stroke]) -> None:
        self.strokes = strokes
        self.rows = [np.flatnonzero(s.motion.fresh[s.at]) for s in strokes]
        self.free = []
        for s, at in zip(strokes, self.rows, strict=True):
            t = s.motion.t[s.at][at]
            powers = np.vander((t - t[0]) / (t[-1] - t[0]), 2 if s.motion.angle else 1)
            self.free.append(np.linalg.qr(powers)[0])
        self.ends = np.cumsum([0, *map(len, self.rows)])
        self.noise = np.repeat([s.motion.noise for s in strokes], np.diff(self.ends))
        self.y = self.column(Stroke.measured)

    def column(self, of: Column) -> np.ndarray:
        """A column in units of the noise."""
        made = []
        for s, at, Q in zip(self.strokes, self.rows, self.free, strict=True):
            x = of(s)[at]
            x = x - x[0]
            made.append(x - Q @ (Q.T @ x))
        return np.concatenate(made) / self.noise

    def fit(self, columns: dict[str, np.ndarray]) -> Fitted | None:
        """Least squares; None where the columns cannot be separated. The covariance is of what is
        left, with its memory, and of what differs between strokes if that is more."""
        A, names = np.column_stack([*columns.values()]), tuple(columns)
        size = np.linalg.norm(A, axis=0)
        free = len(self.y) - A.shape[1] - sum(Q.shape[1] for Q in self.free)
        if free < 3 or np.any(size == 0) or not np.all(np.isfinite(A)):
            return None
        B = A / size
        H = B.T @ B
        if np.linalg.cond(H) > 1e12:
            return None
        inverse = np.linalg.inv(H)
        p = inverse @ (B.T @ self.y)
        r = self.y - B @ p
        cost, rows = float(r @ r), free / min(memory(r), free / 4)
        V, freedom, G = inverse * max(cost / free, 1.0) * free / rows, rows, len(self.strokes)
        if G >= STROKES:
            ends = zip(self.ends, self.ends[1:], strict=False)
            M = np.array([B[a:b].T @ r[a:b] for a, b in ends])
            sandwich = inverse @ (M.T @ M) @ inverse * G / (G - 1)
            more = np.sqrt(np.maximum(np.diag(sandwich) / np.diag(V), 1.0))
            V, freedom = V * np.outer(more, more), min(rows, G - 1.0)
        V = V * np.outer(1 / size, 1 / size)
        return Fitted(names, p / size, V, freedom, np.sqrt(cost / free), cost, rms(self.y), rows)


def memory(r: np.ndarray) -> float:
    """The integral of the autocorrelation, in rows, up to its first zero."""
    n = len(r)
    f = np.fft.rfft(r, 1 << (2 * n - 1).bit_length())
    c = np.fft.irfft(np.abs(f) ** 2)[:n]
    if c[0] <= 0:
        return 1.0
    c = c / c[0]
    end = np.flatnonzero(c <= 0)
    return float(1 + 2 * np.sum(c[1 : end[0] if len(end) else n]))


def best(strokes: Sequence[Stroke], terms: Sequence[str], more: Sequence[str]) -> Fitted | None:
    """The fit of the terms, with further ones that are clearly there and a fall that is likely."""
    table = Table(strokes)
    columns = {k: table.column(LAWS[k]) for k in terms}
    made = table.fit(columns)
    if made is None:
        return None
    angles = all(s.motion.angle for s in strokes) and "sin" not in terms
    for added in (*((k,) for k in more), *([("sin", "cos")] if angles else [])):
        tried = columns | {k: table.column(LAWS[k]) for k in added}
        other = table.fit(tried)
        if other is not None and max(map(other.clear, added)) > CLEARLY:
            made, columns = other, tried
    slow = min(max(s.motion.still, np.abs(s.v).min()) for s in strokes)
    top = max(np.abs(s.v).max() for s in strokes)
    speeds = np.geomspace(slow, max(MOST_FALL * top, 1.01 * slow), FALLS)
    fallen = [table.fit(columns | {"fall": table.column(fall(vs))}) for vs in speeds]
    return likely([made, *(one for one in fallen if one is not None and one["fall"] > 0)])


def likely(fits: Sequence[Fitted]) -> Fitted:
    """The most likely of rival fits; its covariance holds what the others say, each by how likely
    it is (Burnham and Anderson, Model Selection and Multimodel Inference, 2002, section 4.3)."""
    unit = min(f.cost / f.rows for f in fits)
    criterion = np.array([f.cost / unit + 2 * len(f.p) + 2 * ("fall" in f.names) for f in fits])
    weight = np.exp(-0.5 * (criterion - criterion.min()))
    made = fits[int(np.argmax(weight))]
    V = made.V.copy()
    for share, other in zip(weight / weight.sum(), fits, strict=True):
        gap = np.array([other[k] - made[k] if k in other.names else 0.0 for k in made.names])
        gap[[k in ("fall", "vs") for k in made.names]] = 0.0
        V += share * np.outer(gap, gap)
    return replace(made, V=V)


# ---- intervals -------------------------------------------------------------------


SCALE = 1e-3  # relative error of any scale and clock, standard deviation


def student(freedom: float) -> float:
    """Half the width of a 95 % interval in standard errors."""
    return float(stats.t.ppf(0.975, max(freedom, 1.0)))


def interval(
    value: float, error: float, freedom: float, unit: str, *, resolution: float = 0.0
) -> Estimate:
    """A value with its 95 % interval: of its standard error, and of what is known of sensors."""
    known = np.hypot(resolution, SCALE * value)
    half = np.hypot(student(freedom) * error, Z95 * known)
    return Estimate(float(value), unit, (float(value - half), float(value + half)))
