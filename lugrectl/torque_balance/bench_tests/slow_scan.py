"""Slow scan both ways: half the difference of the directions is friction, half the sum cogging."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import unit_for
from ...core.display import number
from ...estimates.bench_test import BenchTable, BenchTest, in_words
from ...estimates.findings import Estimate
from .momentum import interval, solved
from .motion import Motion

EVEN = 0.4  # of its mean, by which the speed of a scan may vary (RMS)
DRIFT = 0.15  # of its mean, by which thirds of a scan may differ in speed
ALIKE = 1.25  # ratio of the speeds of two scans of one test, at most
ENDS = 0.04  # of a scan at each end, in which the speed settles
TURN = 0.9  # of a turn, that both directions must pass
WRONG = 0.15  # of J as it shows by the ripple: friction is not even
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


class Scans:
    """The cells of all scans: angle, torque, direction, and columns of friction and harmonics."""

    def __init__(self, each: Sequence[Scan]) -> None:
        self.each = each
        self.x, self.u = (np.concatenate([getattr(s, k) for s in each]) for k in ("x", "u"))
        self.side = np.concatenate([np.full(len(s.x), np.sign(s.w)) for s in each])
        self.columns = np.column_stack([self.side, _harmonics(self.x)])


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
    every = Scans(scans)
    force, error = _accelerating(every, J)
    table = _table(every, force, motion)
    if table is None:
        return None
    values = _values(every, force, error, motion)
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


def _accelerating(scans: Scans, J: float | None) -> tuple[np.ndarray, np.ndarray]:
    """The torque that accelerates the axis in each cell, and its standard error: the speed is not
    quite even. J shows in how this differs between the directions."""
    A, u, n = scans.columns, scans.u, np.arange(1, ORDERS + 1)
    p = solved(A, u).p
    size = np.hypot(p[2 : 2 + ORDERS], p[2 + ORDERS :])
    large = size > LITTLE * size.max()  # the noise of the others is no acceleration
    made = []
    for s in scans.each:
        q = solved(_harmonics(s.x), s.v).p
        cos, sin = np.split(_harmonics(s.x)[:, 1:], 2, axis=1)
        b, c = q[1 : 1 + ORDERS] * large, q[1 + ORDERS :] * large
        made.append(np.c_[cos @ b + sin @ c, s.w * (cos @ (n * c) - sin @ (n * b))])
    uneven = np.concatenate(made)  # speed beyond its mean, and acceleration
    rate = uneven[:, 1]
    if J:
        return J * rate, 0.0 * rate
    fit = solved(np.column_stack([A, uneven]), u)
    known = np.hypot(np.sqrt(fit.V[-1, -1]), WRONG * fit.p[-1])
    return max(fit.p[-1], 0.0) * rate, known * rate


def _values(scans: Scans, force: np.ndarray, error: np.ndarray, motion: str) -> dict[str, Estimate]:
    """Friction, and the largest harmonics of the torque over the turn."""
    A = scans.columns
    fit = solved(A, scans.u - force)
    p, V = fit.p, np.diag(fit.V) + solved(A, error).p ** 2
    unit, freedom = unit_for("N m", motion), fit.rows
    register = max(s.motion.step for s in scans.each) / np.sqrt(12)
    made = {"Fc": interval(float(p[0]), float(np.sqrt(V[0])), freedom, unit, resolution=register)}
    size = np.hypot(p[2 : 2 + ORDERS], p[2 + ORDERS :])
    own = np.sqrt(np.maximum(V[2 : 2 + ORDERS], V[2 + ORDERS :]))
    for i in np.argsort(-size)[:LARGEST]:
        if size[i] > CLEARLY * own[i]:
            name = f"cogging.{i + 1}"
            fine = register / np.sqrt(CELLS)
            made[name] = interval(float(size[i]), float(own[i]), freedom, unit, resolution=fine)
    return made


def _table(scans: Scans, force: np.ndarray, motion: str) -> BenchTable | None:
    """Cogging and friction over the turn; None where a direction has not passed nearly all."""
    u = scans.u - force
    cell = (np.mod(scans.x, 2 * np.pi) / (2 * np.pi) * BINS).astype(int) % BINS
    means = []
    for way in (1, -1):
        at = scans.side == way
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
