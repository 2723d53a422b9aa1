"""Free swing: without torque, the motion oscillates about the lowest angle of the load.

    x'' = -S sin x - C cos x - Fv/J x' - (Fc/J + (Fs - Fc)/J exp(-(x'/vs)^2)) sign(x')

fitted as a whole trajectory to what was measured of it: in central differences, whose unknowns are
solved for at once. The equations are a band, and so are those of the sensitivities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, solve_banded

from ...blocks.friction import level
from ...estimates.bench_test import BenchTest, in_words
from ...estimates.findings import Estimate
from .momentum import EXPLAINED, SHORTEST, Fitted, Stroke, best, interval, likely, memory, solved
from .motion import Motion
from .pushes_and_coasts import ZERO

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
    fits = [made for swings in runs if (made := _trajectory(swings)) is not None]
    fits = [made for made in fits if made.left <= EXPLAINED * made.moved]
    if not fits:
        return None
    values = _values(fits)
    swings = sum(map(len, runs))
    many = f"{swings} free swings" if swings > 1 else "One free swing"
    return BenchTest(KIND, f"{many}: {in_words(values)}.", values)


def _trajectory(swings: Sequence[Stroke]) -> Fitted | None:
    """The whole trajectories; values to begin with are those of periods, one by one."""
    parts = [part for s in swings for part in _periods(s)]
    start = best(parts, NAMES[:4], ()) if parts else None
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
    n = max(round(2 * np.pi / np.sqrt(pull) / KNOTS / s.motion.dt), 1)
    x, y = (z[: len(z) // n * n].reshape(-1, n).mean(1) for z in (s.x - s.x0, s.measured()))
    y = x if s.motion.angle else y
    return Swing(n * s.motion.dt, x, y[1:-1], not s.motion.angle)


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
    """Strokes in turn forwards and backwards, each shorter than the last; the first may be cut."""
    found: list[list[slice]] = [[]]
    for stroke in one.strokes:
        if stroke.start < at.start or stroke.stop > at.stop or np.ptp(one.x[stroke]) < LEAST:
            continue
        if found[-1]:
            last = found[-1][-1]
            turned = one.side[last.start] != one.side[stroke.start]
            soon = stroke.start - last.stop < last.stop - last.start
            shorter = np.ptp(one.x[stroke]) < np.ptp(one.x[last]) or len(found[-1]) == 1
            if not (turned and soon and shorter):
                found.append([])
        found[-1].append(stroke)
    return found


def _values(fits: Sequence[Fitted]) -> dict[str, Estimate]:
    """Of all runs: each has its own zero of the angle, so that only the size of gravity is one."""
    freedom = sum(made.freedom for made in fits)

    def mean(found: Sequence[tuple[float, float]], unit: str) -> Estimate:
        """By the errors of the runs, wider where they differ by more."""
        value, error = np.array(found).T
        weight = error**-2
        mean, own = float(weight @ value / weight.sum()), float(weight.sum() ** -0.5)
        apart = float(weight @ (value - mean) ** 2) / max(len(value) - 1, 1)
        return interval(mean, own * max(1.0, np.sqrt(apart)), freedom, unit)

    pulls = []
    for made in fits:
        at = [made.names.index(key) for key in ("sin", "cos")]
        size = float(np.hypot(*made.p[at]))
        g = made.p[at] / size
        pulls.append((size, float(np.sqrt(g @ made.V[np.ix_(at, at)] @ g))))
    pull = mean(pulls, "rad/s2")
    low, high = pull.ci95 or (pull.value, pull.value)
    values = {"length": Estimate(G / pull.value, "m", (G / high, G / low)), "gravity/J": pull}
    for key, unit in (("Fc", "rad/s2"), ("Fv", "1/s")):
        values[f"{key}/J"] = mean([(made[key], made.error(key)) for made in fits], unit)
    return values


# ---- the trajectory --------------------------------------------------------------


KNOTS = 150  # of a period
ROUNDS = 8  # of Gauss and Newton
SETTLED = 1e-2  # standard errors of a step that ends them
FAR = 10.0  # rad, by which no trajectory moves in a step
LONGEST = 0.7  # step of log(vs)
SHARP = 1e-3  # of the top speed, over which the sign turns


@dataclass(frozen=True, eq=False)
class Swing:
    """Means ``y`` over cells of ``h`` s."""

    h: float
    x: np.ndarray  # an angle to begin with
    y: np.ndarray
    speed: bool  # y are speeds, else angles

    def forces(self, p: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The acceleration at the inner knots, its slopes by x and speed; the values' columns."""
        v = (x[2:] - x[:-2]) / (2 * self.h)
        x = x[1:-1]
        e = SHARP * float(np.abs(v).max())
        root = np.sqrt(v**2 + e**2)
        s, ds = v / root, e**2 / root**3
        columns = [np.sin(x), np.cos(x), s, v]
        slope = p[2] * ds + p[3]
        if len(p) > 4:
            fall, vs = p[4], np.exp(p[5])
            g = level(v, 0.0, 1.0, vs)
            columns += [s * g, fall * s * g * 2 * (v / vs) ** 2]
            slope = slope + fall * g * (ds - 2 * s * v / vs**2)
        return np.array(columns), p[0] * np.cos(x) - p[1] * np.sin(x), slope

    def linear(self, p: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The band of the equations, what they leave, and the columns of the values."""
        columns, by_x, by_v = self.forces(p, x)
        h, n = self.h, len(x)
        left = np.diff(x, 2) / h**2 + p[:5] @ columns[:5]
        band = np.zeros((3, n))
        band[0] = 1.0
        band[0, 2:] = 1 / h**2 + by_v / (2 * h)
        band[1, 1:-1] = -2 / h**2 + by_x
        band[2, :-2] = 1 / h**2 - by_v / (2 * h)
        return band, left, columns

    def trajectory(self, p: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The solution that begins with the first two knots of x."""
        for _ in range(ROUNDS):
            band, left, _ = self.linear(p, x)
            step = solve_banded((2, 0), band, np.r_[0.0, 0.0, left])
            x = x - step
            if not np.abs(step).max() < FAR:
                raise np.linalg.LinAlgError("the swing turns over")
            if np.abs(step).max() < 1e-7 * np.ptp(x):
                break
        return x

    def slopes(self, p: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The derivatives of the trajectory by the values and its first two knots."""
        band, _, columns = self.linear(p, x)
        rhs = np.zeros((len(x), len(p) + 2))
        rhs[2:, : len(p)] = -columns.T
        rhs[0, len(p)] = 1.0
        rhs[:2, len(p) + 1] = 0.0, 1.0
        return solve_banded((2, 0), band, rhs)

    def seen(self, x: np.ndarray) -> np.ndarray:
        """What is measured of a trajectory, at its inner knots."""
        return (x[2:] - x[:-2]) / (2 * self.h) if self.speed else x[1:-1]


def fitted(swings: Sequence[Swing], p: np.ndarray, names: tuple[str, ...]) -> Fitted | None:
    """The values that all swings share (S, C, Fc/J, Fv/J, and of falling friction (Fs - Fc)/J and
    log(vs)), by least squares from a start; None where it leads nowhere."""
    m, xs = len(p), [s.x for s in swings]
    moved = float(np.std(np.concatenate([s.y for s in swings])))
    made = None
    for _ in range(ROUNDS):
        try:
            xs = [s.trajectory(p, x) for s, x in zip(swings, xs, strict=True)]
        except np.linalg.LinAlgError:
            return None
        slopes = [s.seen(s.slopes(p, x)) for s, x in zip(swings, xs, strict=True)]
        # two knots of each swing are unknown, too
        A = np.c_[np.concatenate([own[:, :m] for own in slopes]),
                  block_diag(*(own[:, m:] for own in slopes))]  # fmt: skip
        r = np.concatenate([s.y - s.seen(x) for s, x in zip(swings, xs, strict=True)])
        if len(r) - A.shape[1] < 3 or not (np.all(np.isfinite(A)) and np.all(np.isfinite(r))):
            return None
        size = np.linalg.norm(A, axis=0)
        fit = solved(A / size, r)
        step, cost, together = fit.p / size, float(r @ r), memory(r)
        V = fit.H / np.outer(size, size) * cost / fit.free * together
        p = p + np.r_[step[: min(m, 5)], np.clip(step[5:m], -LONGEST, LONGEST)]
        for x, own in zip(xs, step[m:].reshape(-1, 2), strict=True):
            x[:2] += own
        left, rows = float(np.sqrt(cost / fit.free)), fit.free / together
        made = Fitted(names, p, V[:m, :m], rows, left, cost, moved, rows)
        if np.all(np.abs(step) < SETTLED * np.sqrt(np.diag(V))):
            break
    return made
