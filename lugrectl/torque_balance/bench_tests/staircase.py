"""Staircase of speeds: a point of the friction curve from each plateau, a part of a log in which
the axis keeps its speed, and Stribeck's law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import unit_for
from ...blocks.friction import level
from ...core.numeric import Z95
from ...estimates.bench_test import ONE_WAY, BenchTable, BenchTest, in_words
from ...estimates.findings import Estimate
from .momentum import SCALE, Solved, interval, solved, student
from .motion import Motion

BLOCK = 0.1  # s, over which a speed is taken
MOST = 3000  # blocks of a log
KEEPS = 0.06  # of its speed, within which a plateau keeps it
NOISE = 3.0  # standard deviations of the noise that are allowed beside it
FEWEST = 4  # blocks
SETTLING = 0.3  # of a plateau, at its start, in which the loop settles
STEADY = 0.008  # of its speed, by which the halves of a plateau may differ
SWINGS = 1.2  # standard deviations of the noise, by which the angle leaves a line
LEVEL = 1.12  # ratio of two speeds that are two


@dataclass(frozen=True, eq=False)
class Plateau:
    """Rows ``at`` of a motion at the mean speed ``w``, out of ``rows`` before it had settled."""

    motion: Motion
    at: slice
    w: float
    rows: int

    @property
    def error(self) -> float:
        """The standard deviation of w by the noise of the motion."""
        n = self.at.stop - self.at.start
        if self.motion.w is not None:
            return self.motion.noise / np.sqrt(n)
        return self.motion.noise * np.sqrt(2) / (n * self.motion.dt)

    @property
    def swings(self) -> bool:
        """Whether the axis sticks and slips: more than noise leaves the straight line."""
        one, t = self.motion, self.motion.t[self.at]
        if one.w is not None:
            return bool(np.std(one.w[self.at]) > SWINGS * one.noise)
        x = one.x[self.at]
        off = x - np.polyval(np.polyfit(t - t[0], x - x[0], 1), t - t[0])
        return bool(np.std(off) > SWINGS * one.noise)


def plateaus(one: Motion) -> tuple[list[Plateau], int]:
    """The plateaus of a motion, and the rows in which the axis moves."""
    size = max(int(BLOCK / one.dt), len(one) // MOST, 5)
    many = len(one) // size
    if one.w is not None:  # mean speeds of blocks, and the standard deviation of their noise
        b = np.where(one.stale, 0.0, one.w)[: many * size].reshape(many, size).mean(1)
        noise = one.noise / np.sqrt(size)
    else:
        ends = np.arange(many + 1) * size
        b = np.diff(one.x[ends - (ends >= len(one))]) / (size * one.dt)
        noise = one.noise * np.sqrt(2) / (size * one.dt)
    if len(b) < FEWEST:
        return [], 0
    made, k = [], 0
    while k + FEWEST <= len(b):
        total, end = b[k], k + 1
        while end < len(b):  # up to the first block whose speed is another
            mean = total / (end - k)
            if abs(b[end] - mean) > KEEPS * abs(mean) + NOISE * noise:
                break
            total, end = total + b[end], end + 1
        if end - k >= FEWEST:
            made += _settled(one, k, end, size)
        k = end if end - k >= FEWEST else k + 1
    return made, int(np.count_nonzero(np.abs(b) > NOISE * noise)) * size


def _settled(one: Motion, k: int, end: int, size: int) -> list[Plateau]:
    """The plateau of some blocks without the rows in which its speed settles; none of a rest."""
    first = k + max(int(np.ceil(SETTLING * (end - k))), 1)
    at = slice(first * size, max(end - 1, first + 1) * size)
    x, t = one.x[at], one.t[at]
    w = float((x[-1] - x[0]) / (t[-1] - t[0]))
    found = Plateau(one, at, w, (end - k) * size)
    middle = len(x) // 2
    later = float((x[-1] - x[middle]) / (t[-1] - t[middle]))
    steady = abs(later - w) < 0.5 * STEADY * abs(w) + 2 * NOISE * found.error
    return [found] if steady and abs(w) > 2 * NOISE * found.error else []


LEVELS = 4  # different speeds, at least
COVERED = 0.6  # of the moving rows, that must be on plateaus
PARTS = 8  # of a plateau, at most, whose scatter tells its error
SLOWLY = 2.0  # times its change from row to row, by which a torque wanders: no noise of a loop
SWINGING = 0.25  # of the torque's RMS, by which its mean is no friction where the speed swings
LOWEST = 0.25  # of the slowest plateau, where a fall is tried at least
SCATTERED = 0.05  # of the torque, by which the points may be off their curve
SPEEDS = 60  # at which friction may fall
FAR = 20.0  # of the misfit's unit, within which a vs is looked at more closely
CLEARLY = 10.0  # of this unit, by which a fall of friction lowers the misfit
TOO_FAST = "No plateau is slow and steady enough for Fs and vs."
KIND = "staircase"


def staircase(motions: Sequence[Motion], motion: str) -> BenchTest | None:
    """The friction curve of the plateaus with Fc, Fv, and Fs and vs where friction falls."""
    both = [plateaus(one) for one in motions]
    found = [p for parts, _ in both for p in parts]
    covered, moving = sum(p.rows for p in found), sum(rows for _, rows in both)
    w = np.array([p.w for p in found])
    levels = 1 + int(np.sum(np.diff(np.log(np.sort(np.abs(w)))) > np.log(LEVEL)))
    if not len(w) or covered < COVERED * moving or levels < LEVELS:
        return None
    u, error = np.array([_torque(p) for p in found]).T
    error_u = np.hypot(error, 1e-4 * np.abs(u).max())
    values = fitted(Points(w, u, error_u, np.array([p.error for p in found])), motion)
    if values is None:
        return None
    torque, speed = unit_for("N m", motion), unit_for("rad/s", motion)
    rows = tuple(
        (float(w[i]), float(u[i]), Z95 * float(np.hypot(error[i], SCALE * u[i])))
        for i in np.argsort(w)
    )
    table = BenchTable((f"w [{speed}]", f"u [{torque}]", f"+- [{torque}]"), rows)
    said = f"Staircase of {len(w)} plateaus: {in_words(values)}."
    falls = any(k.startswith("Fs") for k in values)
    return BenchTest(KIND, said if falls else f"{said} {TOO_FAST}", values, table)


def _torque(p: Plateau) -> tuple[float, float]:
    """The mean torque of a plateau and its standard error."""
    u = p.motion.u[p.at]
    parts = np.array_split(u, min(PARTS, len(u)))
    error = float(np.std([part.mean() for part in parts], ddof=1) / np.sqrt(len(parts)))
    slow = float(np.std(u)) > SLOWLY * float(np.std(np.diff(u)))
    if p.swings or slow:
        error = np.hypot(error, SWINGING * float(np.std(u)))
    return float(u.mean()), float(np.hypot(error, p.motion.step / np.sqrt(12)))


@dataclass(frozen=True, eq=False)
class Points:
    """Speeds and torques of plateaus (n,) with their standard errors."""

    w: np.ndarray
    u: np.ndarray
    error: np.ndarray
    error_w: np.ndarray

    @property
    def plain(self) -> list[np.ndarray]:
        """The columns of Coulomb and viscous friction, and of a constant in two directions."""
        both = np.ptp(np.sign(self.w)) > 0
        return [np.sign(self.w), self.w, *([np.ones(len(self.w))] if both else [])]

    def falling(self, vs: float) -> tuple[Solved, float]:
        """The fit with friction that falls at vs, where an error of w is one of u; the misfit is
        twice a negative log-likelihood."""
        size, own = np.abs(self.w), self.error
        fall = level(size, 0.0, 1.0, vs)
        columns = np.column_stack([*self.plain, np.sign(self.w) * fall])
        for _ in range(2):
            slope = solved(columns / own[:, None], self.u / own).p[-1] * 2 * size / vs**2 * fall
            own = np.hypot(self.error, slope * self.error_w)
        fit = solved(columns / own[:, None], self.u / own)
        return fit, fit.cost + 2 * float(np.sum(np.log(own / self.error)))


def fitted(points: Points, motion: str) -> dict[str, Estimate] | None:
    """Stribeck's law along the points: levels solved for at each vs, averaged by likelihood."""
    size, plain, error = np.abs(points.w), points.plain, points.error
    n, free = len(plain), len(size) - len(plain) - 2
    if free < 1:
        return None
    straight = solved(np.column_stack(plain) / error[:, None], points.u / error)
    speeds = np.geomspace(LOWEST * size.min(), size.max(), SPEEDS)
    for _ in range(2):  # all speeds, then more of those that are likely
        fits = [points.falling(vs) for vs in speeds]
        cost = np.array([misfit if f.p[-1] > 0 else np.inf for f, misfit in fits])
        unit = max(min(float(cost.min()), straight.cost) / free, 1.0)
        near = np.flatnonzero(cost < cost.min() + FAR * unit)
        if not len(near):
            break
        ends = speeds[max(near[0] - 1, 0)], speeds[min(near[-1] + 1, SPEEDS - 1)]
        last, speeds = speeds, np.geomspace(*ends, SPEEDS)
    off = np.sqrt(min(float(cost.min()), straight.cost) / free) * np.median(error)
    if off > SCATTERED * np.abs(points.u).mean():  # on no curve
        return None
    falls = straight.cost - cost.min() > CLEARLY * unit
    fits = [f for f, _ in fits]
    made = fits[int(np.argmin(cost))] if falls else straight
    if made.p[0] <= 0:  # no friction: the axis only seems to keep its speed
        return None
    likely = np.exp(-0.5 * (cost - cost.min()) / unit) if falls else np.zeros(SPEEDS)
    likely /= max(likely.sum(), 1.0)
    gap = np.array([f.p[:n] for f in fits]) - made.p[:n]
    V = made.H[:n, :n] * unit + np.einsum("i,ij,ik->jk", likely, gap, gap)
    more = "" if n > 2 else ONE_WAY
    values = {}
    for i, (k, name) in enumerate({"Fc" + more: "N m", "Fv": "N m s/rad"}.items()):
        spread = float(np.sqrt(V[i, i]))
        values[k] = interval(made.p[i], spread, free, unit_for(name, motion))
    fall = _fall(fits, last, likely, (unit, free), motion) if falls else {}
    return values | {k + more * (k == "Fs"): e for k, e in fall.items()}


def _fall(
    fits: Sequence[Solved],
    speeds: np.ndarray,
    likely: np.ndarray,
    scale: tuple[float, int],
    motion: str,
) -> dict[str, Estimate]:
    """Fs and vs, whose intervals hold what other vs say; ``scale``: misfit's unit, freedom."""
    best, (unit, free) = int(np.argmax(likely)), scale
    Fs = np.array([f.p[0] + f.p[-1] for f in fits])
    V = fits[best].H
    own = float(V[0, 0] + V[-1, -1] + 2 * V[0, -1]) * unit
    error = np.sqrt(own + likely @ (Fs - Fs[best]) ** 2)
    log = np.log(speeds)
    spread = likely @ (log - log[best]) ** 2 + (log[1] - log[0]) ** 2 / 12
    half, vs = student(free) * float(np.sqrt(spread)), float(speeds[best])
    ends = (vs * float(np.exp(-half)), vs * float(np.exp(half)))
    static = interval(float(Fs[best]), float(error), free, unit_for("N m", motion))
    if half > 1 or (static.ci95 or (0.0,))[0] <= 0:  # too few plateaus are slow enough
        return {}
    return {"Fs": static, "vs": Estimate(vs, unit_for("rad/s", motion), ends)}
