"""Slow scan both ways: half the difference of the directions is friction, half the sum cogging."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..blocks.block import unit_for
from ..core.display import number
from ..estimates.bench_test import BenchTable, BenchTest, in_words
from ..estimates.findings import Estimate
from .momentum import Stroke, Table, coulomb, memory, stroked
from .motion import Motion
from .scatter import interval

EVEN = 0.4  # of its mean, by which the speed of a scan may vary (RMS)
DRIFT = 0.15  # of its mean, by which thirds of a scan may differ in speed
ALIKE = 1.25  # ratio of the speeds of two scans of one test, at most
ENDS = 0.04  # of a scan at each end, in which the speed settles
TURN = 0.9  # of a turn, that both directions must pass
STARTS = 0.15  # of a scan at its start, which shows the inertia
WRONG = (0.15, 0.6)  # of J as it shows by the ripple and by the starts: friction is not even
LITTLE = 0.02  # of the largest harmonic: less accelerates nothing
MOSTLY = 0.5  # of the moving rows that are scans
CELLS = 720  # of a turn, over which rows are averaged
BINS = 72  # of a turn in the table
ORDERS = 40  # per turn
LARGEST, CLEARLY = 6, 5.0  # harmonics that are named, and standard errors from which on
KIND = "slow_scan"


@dataclass(frozen=True, eq=False)
class Scan:
    """A motion at one speed ``w``: angle, torque and speed in cells of the turn."""

    motion: Motion
    at: slice
    x: np.ndarray
    u: np.ndarray
    v: np.ndarray
    w: float

    @property
    def side(self) -> np.ndarray:
        return np.full(len(self.x), np.sign(self.w))


def slow_scan(motions: Sequence[Motion], J: float | None, motion: str) -> BenchTest | None:
    """Friction at the speed of the scan, and the cogging over the turn."""
    scans = [s for one in motions for at in one.strokes if (s := _scan(one, at)) is not None]
    if motion != "rotary" or not scans:
        return None
    speeds = np.array([s.w for s in scans])
    moving = sum(np.count_nonzero(one.side) for one in motions)
    one_speed = np.abs(speeds).max() < ALIKE * np.abs(speeds).min()
    rows = sum(s.at.stop - s.at.start for s in scans)
    if len({*np.sign(speeds)}) < 2 or not one_speed or rows < MOSTLY * moving:
        return None
    force, error = _accelerating(scans, J)
    table = _table(scans, force, motion)
    if table is None:
        return None
    values = _values(scans, force, error, motion)
    V = float(np.abs(speeds).mean())
    said = f"Slow scan both ways at {number(V, 3)} rad/s (Fc is the friction at that speed)"
    return BenchTest(KIND, f"{said}: {in_words(values)}.", values, table)


def _scan(one: Motion, at: slice) -> Scan | None:
    """The cells of a motion of nearly a turn at one speed."""
    n = at.stop - at.start
    cut = slice(at.start + int(ENDS * n), at.stop - int(ENDS * n))
    x, t = one.x[cut], one.t[cut]
    if len(x) < 2 * BINS or np.ptp(x) < TURN * 2 * np.pi:
        return None
    w = float((x[-1] - x[0]) / (t[-1] - t[0]))
    thirds = [float(np.mean(part)) for part in np.array_split(one.v[cut], 3)]
    if np.std(one.v[cut]) > EVEN * abs(w) + 2 * one.speeds[1] or np.ptp(thirds) > DRIFT * abs(w):
        return None
    many = max(round(2 * np.pi / CELLS / (abs(w) * one.dt)), 1)
    count = len(x) // many

    def cells(y: np.ndarray) -> np.ndarray:
        return y[cut][: count * many].reshape(count, many).mean(1)

    x = cells(one.x) + 0.5 * one.dt * w  # the torque is held over the step that follows
    v = np.gradient(x, many * one.dt) if one.w is None else cells(one.w)
    return Scan(one, at, x, cells(one.u), v, w)


def _harmonics(x: np.ndarray) -> np.ndarray:
    phase = x[:, None] * np.arange(1, ORDERS + 1)
    return np.column_stack([np.ones(len(x)), np.cos(phase), np.sin(phase)])


def _solved(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    H = np.linalg.pinv(A.T @ A)
    return H @ (A.T @ y), H


def _accelerating(scans: Sequence[Scan], J: float | None) -> tuple[np.ndarray, np.ndarray]:
    """The torque that accelerates the axis in each cell, and its standard error: the speed is not
    quite even. J shows in how this differs between the directions, and where the axis starts."""
    x, side = np.concatenate([s.x for s in scans]), np.concatenate([s.side for s in scans])
    u, n = np.concatenate([s.u for s in scans]), np.arange(1, ORDERS + 1)
    A = np.column_stack([side, _harmonics(x)])
    p = _solved(A, u)[0]
    size = np.hypot(p[2 : 2 + ORDERS], p[2 + ORDERS :])
    large = size > LITTLE * size.max()  # the noise of the others is no acceleration
    made = []
    for s in scans:
        q = _solved(_harmonics(s.x), s.v)[0]
        cos, sin = np.split(_harmonics(s.x)[:, 1:], 2, axis=1)
        b, c = q[1 : 1 + ORDERS] * large, q[1 + ORDERS :] * large
        made.append(np.c_[cos @ b + sin @ c, s.w * (cos @ (n * c) - sin @ (n * b))])
    uneven = np.concatenate(made)  # speed beyond its mean, and acceleration
    rate = uneven[:, 1]
    if J:
        return J * rate, 0.0 * rate
    found = [_by_ripple(np.column_stack([A, uneven]), u), _by_starts(scans, p)]
    value, error = min(found, key=lambda f: f[1])
    value = max(value, 0.0)
    return value * rate, error * rate


def _by_ripple(A: np.ndarray, u: np.ndarray) -> tuple[float, float]:
    """J and its standard error, by the last column."""
    p, H = _solved(A, u)
    r = u - A @ p
    free = max(len(u) - A.shape[1], 1)
    error = np.sqrt(H[-1, -1] * (r @ r) / free * min(memory(r), free / 8))
    return float(p[-1]), float(np.hypot(error, WRONG[0] * p[-1]))


def _by_starts(scans: Sequence[Scan], p: np.ndarray) -> tuple[float, float]:
    """J and its standard error, by the momentum of the starts."""
    strokes = []
    for s in scans:
        n = int(STARTS * (s.at.stop - s.at.start))
        made = stroked(s.motion, slice(s.at.start, s.at.start + max(n, 4 * s.motion.window)))
        strokes += [made] if made is not None else []

    def driving(s: Stroke) -> np.ndarray:
        return s.held(s.motion.u[s.at] - _harmonics(s.x) @ p[1:])

    made = Table(strokes).fitted({"1/J": driving, "Fc": coulomb}) if strokes else None
    if made is None or made["1/J"] <= 0:
        return 0.0, np.inf
    J, error = 1 / made["1/J"], made.error("1/J") / made["1/J"] ** 2
    return J, float(np.hypot(error, WRONG[1] * J))


def _values(
    scans: Sequence[Scan], force: np.ndarray, error: np.ndarray, motion: str
) -> dict[str, Estimate]:
    """Friction, and the largest harmonics of the torque over the turn."""
    x, side = np.concatenate([s.x for s in scans]), np.concatenate([s.side for s in scans])
    u = np.concatenate([s.u for s in scans]) - force
    A = np.column_stack([side, _harmonics(x)])
    p, H = _solved(A, u)
    r = u - A @ p
    free = max(len(u) - A.shape[1], 1)
    together = min(memory(r), free / 8)
    V = np.diag(H) * float(r @ r) / free * together + (H @ (A.T @ error)) ** 2
    unit, freedom = unit_for("N m", motion), free / together
    register = max(s.motion.step for s in scans) / np.sqrt(12)
    made = {"Fc": interval(float(p[0]), float(np.sqrt(V[0])), freedom, unit, resolution=register)}
    size = np.hypot(p[2 : 2 + ORDERS], p[2 + ORDERS :])
    own = np.sqrt(np.maximum(V[2 : 2 + ORDERS], V[2 + ORDERS :]))
    for i in np.argsort(-size)[:LARGEST]:
        if size[i] > CLEARLY * own[i]:
            name = f"cogging.{i + 1}"
            fine = register / np.sqrt(CELLS)
            made[name] = interval(float(size[i]), float(own[i]), freedom, unit, resolution=fine)
    return made


def _table(scans: Sequence[Scan], force: np.ndarray, motion: str) -> BenchTable | None:
    """Cogging and friction over the turn; None where a direction has not passed nearly all."""
    x, side = np.concatenate([s.x for s in scans]), np.concatenate([s.side for s in scans])
    u = np.concatenate([s.u for s in scans]) - force
    cell = (np.mod(x, 2 * np.pi) / (2 * np.pi) * BINS).astype(int) % BINS
    means = []
    for way in (1, -1):
        at = side == way
        many = np.bincount(cell[at], minlength=BINS)
        with np.errstate(all="ignore"):
            means.append(np.bincount(cell[at], u[at], minlength=BINS) / many)
    forward, backward = means
    half, sums = 0.5 * (forward - backward), 0.5 * (forward + backward)
    if np.isfinite(half).mean() < TURN:
        return None
    middle = (np.arange(BINS) + 0.5) * 2 * np.pi / BINS
    sums = sums - np.nanmean(sums)
    rows = tuple(
        tuple(float(z) if np.isfinite(z) else None for z in row)
        for row in zip(middle, sums, half, strict=True)
    )
    unit = unit_for("N m", motion)
    return BenchTable(("theta [rad]", f"cogging [{unit}]", f"friction [{unit}]"), rows)
