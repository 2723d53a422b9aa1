"""Free swing: without torque, the motion oscillates about the lowest angle of the load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..estimates.bench_test import BenchTest, in_words
from ..estimates.findings import Estimate
from .coast_down import ZERO
from .momentum import (
    EXPLAINED,
    SHORTEST,
    Column,
    Fitted,
    Stroke,
    best,
    cosine,
    coulomb,
    likely,
    sine,
    viscous,
)
from .motion import Motion
from .scatter import interval
from .swing_trajectory import KNOTS, Swing, fitted

G = 9.81  # m/s2
HALVES = 3  # half-swings, at least
LEAST = 0.02  # rad, of a half-swing
FALLS = (0.05, 0.2)  # of the top speed, from where the fall of friction is searched
NAMES = ("sin", "cos", "Fc", "Fv", "fall", "vs")
KIND = "free_swing"


def free_swing(motions: Sequence[Motion], motion: str) -> BenchTest | None:
    """Length, gravity, damping and friction of all swings, for each unit of inertia."""
    if motion != "rotary":
        return None
    runs = [found for one in motions if (found := _swings(one))]
    fits = [made for swings in runs if (made := _fitted(swings)) is not None]
    fits = [made for made in fits if made.left <= EXPLAINED * made.moved]
    if not fits:
        return None
    values = _values(fits)
    swings = sum(map(len, runs))
    many = f"{swings} free swings" if swings > 1 else "One free swing"
    return BenchTest(KIND, f"{many}: {in_words(values)}.", values)


def _fitted(swings: Sequence[Stroke]) -> Fitted | None:
    """The whole trajectories; values to begin with are those of periods, one by one."""
    terms: dict[str, Column] = {"sin": sine, "cos": cosine, "Fc": coulomb, "Fv": viscous}
    parts = [part for s in swings for part in _periods(s)]
    start = best(parts, terms, {}) if parts else None
    if start is None:
        return None
    pull = float(np.hypot(start["sin"], start["cos"]))
    cells = [_cells(s, pull) for s in swings]
    p = np.array([start["sin"], start["cos"], max(start["Fc"], 0.0), max(start["Fv"], 0.0)])
    plain = fitted(cells, p, NAMES[:4])
    if plain is None:
        return None
    top = max(s.motion.top for s in swings)
    fits = [plain]
    for vs in FALLS:
        fallen = fitted(cells, np.r_[plain.p, 0.2 * plain["Fc"], np.log(vs * top)], NAMES)
        fits += [fallen] if fallen is not None and fallen["fall"] > 0 else []
    return likely(fits)


def _cells(s: Stroke, pull: float) -> Swing:
    """A swing as means over cells, from the angle of which its sine and cosine are taken."""
    dt = s.motion.dt
    n = max(round(2 * np.pi / np.sqrt(pull) / KNOTS / dt), 1)
    many = len(s.x) // n

    def cells(x: np.ndarray) -> np.ndarray:
        return x[: many * n].reshape(many, n).mean(1)

    x = cells(s.x - s.x0)
    y = x if s.motion.angle else cells(s.measured())
    return Swing(n * dt, x, y[1:-1], not s.motion.angle)


def _periods(s: Stroke) -> list[Stroke]:
    """Parts of about one period, over which an integral keeps its noise small."""
    sides = s.motion.side[s.at]
    turns = np.flatnonzero(np.diff(np.sign(sides[sides != 0])))
    if len(turns) < 2:
        return [s]
    many = max((len(turns) + 1) // 2, 1)
    edges = np.linspace(s.at.start, s.at.stop, many + 1).astype(int)
    made = [Stroke(s.motion, slice(a, b), s.x[0]) for a, b in zip(edges, edges[1:], strict=False)]
    return [one for one in made if one.at.stop - one.at.start >= SHORTEST]


def _swings(one: Motion) -> list[Stroke]:
    """The parts without torque that turn back again and again, each time sooner."""
    largest = max(float(np.abs(one.u).max()), 1e-300)
    found = []
    for piece in one.pieces:
        if not piece.held or (abs(piece.level) > ZERO * largest and np.ptp(one.u)):
            continue
        for inside in _alternating(one, piece.at):
            if len(inside) >= HALVES:
                at = slice(inside[0].start, inside[-1].stop)
                found.append(Stroke(one, at, float(one.x[at.start])))
    return found


def _alternating(one: Motion, at: slice) -> list[list[slice]]:
    """The rows of strokes in turn forwards and backwards, each shorter than the one before."""
    found: list[list[slice]] = [[]]
    for stroke in one.strokes:
        if stroke.start < at.start or stroke.stop > at.stop or np.ptp(one.x[stroke]) < LEAST:
            continue
        last = found[-1][-1] if found[-1] else None
        if last is not None and not _follows(one, last, stroke, first=len(found[-1]) == 1):
            found.append([])
        found[-1].append(stroke)
    return found


def _follows(one: Motion, last: slice, stroke: slice, first: bool) -> bool:
    """Whether a stroke is the way back of the last one; the first one may be cut."""
    turned = one.side[last.start] != one.side[stroke.start]
    rest = stroke.start - last.stop
    shorter = np.ptp(one.x[stroke]) < np.ptp(one.x[last])
    return bool(turned and (shorter or first) and rest < (last.stop - last.start))


def _values(fits: Sequence[Fitted]) -> dict[str, Estimate]:
    """Of all runs: each has its own zero of the angle, so that only the size of gravity is one."""
    pull = _of_all([_pull(made) for made in fits], fits, "rad/s2")
    low, high = pull.ci95 or (pull.value, pull.value)
    values = {"length": Estimate(G / pull.value, "m", (G / high, G / low)), "gravity/J": pull}
    for key, unit in (("Fc", "rad/s2"), ("Fv", "1/s")):
        values[f"{key}/J"] = _of_all([(made[key], made.error(key)) for made in fits], fits, unit)
    return values


def _pull(made: Fitted) -> tuple[float, float]:
    """The size of gravity for each unit of inertia, and its standard deviation."""
    at = [made.names.index(key) for key in ("sin", "cos")]
    size = float(np.hypot(*made.p[at]))
    g = made.p[at] / size
    return size, float(np.sqrt(g @ made.V[np.ix_(at, at)] @ g))


def _of_all(found: Sequence[tuple[float, float]], fits: Sequence[Fitted], unit: str) -> Estimate:
    """The mean of the runs by their errors, wider where they differ by more."""
    value, error = np.array(found).T
    weight = error**-2
    mean, own = float(weight @ value / weight.sum()), float(weight.sum() ** -0.5)
    apart = float(weight @ (value - mean) ** 2) / max(len(value) - 1, 1)
    freedom = sum(made.freedom for made in fits)
    return interval(mean, own * max(1.0, np.sqrt(apart)), freedom, unit)
