"""Staircase of speeds: a point of the friction curve from each plateau, and Stribeck's law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..blocks.block import unit_for
from ..blocks.friction import level
from ..core.numeric import Z95
from ..estimates.bench_test import ONE_WAY, BenchTable, BenchTest, in_words
from ..estimates.findings import Estimate
from .motion import Motion
from .plateaus import Plateau, levels, plateaus
from .scatter import SCALE, interval, student

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
    if not len(w) or covered < COVERED * moving or levels(w) < LEVELS:
        return None
    u, error = np.array([_torque(p) for p in found]).T
    values = fitted(w, u, error, np.array([p.error for p in found]), motion)
    if values is None:
        return None
    torque, speed = unit_for("N m", motion), unit_for("rad/s", motion)
    order = np.argsort(w)
    rows = tuple(
        (float(w[i]), float(u[i]), Z95 * float(np.hypot(error[i], SCALE * u[i]))) for i in order
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


def fitted(
    w: np.ndarray, u: np.ndarray, error: np.ndarray, error_w: np.ndarray, motion: str
) -> dict[str, Estimate] | None:
    """Stribeck's law along the points: solved for the levels at each vs, and averaged over vs by
    how likely it is."""
    s, size = np.sign(w), np.abs(w)
    error = np.hypot(error, 1e-4 * np.abs(u).max())
    plain = [s, w, *([np.ones(len(w))] if np.ptp(s) else [])]
    free = len(w) - len(plain) - 2
    if free < 1:
        return None
    straight = _solve(plain, u, error)
    speeds = np.geomspace(LOWEST * size.min(), size.max(), SPEEDS)
    for _ in range(2):  # all speeds, then more of those that are likely
        fits = [_at(vs, plain, u, error, error_w) for vs in speeds]
        cost = np.array([f[2] if f[0][-1] > 0 else np.inf for f in fits])
        unit = max(min(float(cost.min()), straight[2]) / free, 1.0)
        near = np.flatnonzero(cost < cost.min() + FAR * unit)
        if not len(near):
            break
        ends = speeds[max(near[0] - 1, 0)], speeds[min(near[-1] + 1, SPEEDS - 1)]
        last, speeds = speeds, np.geomspace(*ends, SPEEDS)
    off = np.sqrt(min(float(cost.min()), straight[2]) / free) * np.median(error)
    if off > SCATTERED * np.abs(u).mean():  # on no curve
        return None
    falls = straight[2] - cost.min() > CLEARLY * unit
    p, V, _ = fits[int(np.argmin(cost))] if falls else straight
    if p[0] <= 0:  # no friction: the axis only seems to keep its speed
        return None
    likely = np.exp(-0.5 * (cost - cost.min()) / unit) if falls else np.zeros(SPEEDS)
    likely /= max(likely.sum(), 1.0)
    gap = np.array([f[0][: len(plain)] for f in fits]) - p[: len(plain)]
    V = V[: len(plain), : len(plain)] * unit + np.einsum("i,ij,ik->jk", likely, gap, gap)
    more = "" if np.ptp(s) else ONE_WAY
    units = {"Fc" + more: unit_for("N m", motion), "Fv": unit_for("N m s/rad", motion)}
    made = {k: interval(p[i], float(np.sqrt(V[i, i])), free, units[k]) for i, k in enumerate(units)}
    fall = _fall(fits, last, likely, unit, free, motion) if falls else {}
    return made | {k + more * (k == "Fs"): e for k, e in fall.items()}


def _at(
    vs: float, plain: list[np.ndarray], u: np.ndarray, error: np.ndarray, error_w: np.ndarray
) -> tuple:
    """The same for friction that falls at vs, where an error of w is one of u; the misfit is
    twice a negative log-likelihood."""
    s, size = plain[0], np.abs(plain[1])
    columns = [*plain, s * level(size, 0.0, 1.0, vs)]
    own = error
    for _ in range(2):
        p, V, cost = _solve(columns, u, own)
        slope = p[-1] * 2 * size / vs**2 * level(size, 0.0, 1.0, vs)
        own = np.hypot(error, slope * error_w)
    p, V, cost = _solve(columns, u, own)
    return p, V, cost + 2 * float(np.sum(np.log(own / error)))


def _solve(columns: list[np.ndarray], u: np.ndarray, error: np.ndarray) -> tuple:
    """Values, covariance and misfit of weighted least squares."""
    A = np.column_stack(columns) / error[:, None]
    V = np.linalg.pinv(A.T @ A)
    p = V @ (A.T @ (u / error))
    r = u / error - A @ p
    return p, V, float(r @ r)


def _fall(
    fits: list, speeds: np.ndarray, likely: np.ndarray, unit: float, free: int, motion: str
) -> dict[str, Estimate]:
    """Fs and vs, whose intervals hold what other vs say."""
    best = int(np.argmax(likely))
    Fs = np.array([f[0][0] + f[0][-1] for f in fits])
    V = fits[best][1]
    own = float(V[0, 0] + V[-1, -1] + 2 * V[0, -1]) * unit
    error = np.sqrt(own + likely @ (Fs - Fs[best]) ** 2)
    log = np.log(speeds)
    spread = likely @ (log - log[best]) ** 2 + (log[1] - log[0]) ** 2 / 12
    half, vs = student(free) * float(np.sqrt(spread)), float(speeds[best])
    ends = (vs * float(np.exp(-half)), vs * float(np.exp(half)))
    static = interval(float(Fs[best]), float(error), free, unit_for("N m", motion))
    if half > 1 or (static.ci95 or (0.0,))[0] <= 0:  # too few plateaus are slow enough
        return {}
    return {
        "Fs": static,
        "vs": Estimate(vs, unit_for("rad/s", motion), ends),
    }
