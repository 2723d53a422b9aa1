"""Friction and 1/P in one least squares.

    U(k) = Y(k) W(k) + T(k) + a(k) (Fc Phi1(k) + dF Phi2(k) + c Phi3(k) + ...)

Y = 1/P and T are polynomials in each window; Fc, dF, c are real and common to all windows, Phi
the spectra of the terms of friction along the measured motion. a = (1 + jw lag) exp(jw delay)
takes friction, which does not pass the current loop, to the command. Y and T are projected out of
each window (Frisch and Waugh), so that only the friction is solved for; windows are weighted by
what they leave. Two shapes are searched, the presliding distance and vs, and by how much friction
acts earlier than its motion shows. They serve to take friction out, and are no estimates of sigma0
and vs.

The terms on the motor: the deflection z of a bristle of level 1 (Fc), z exp(-(w/vs)^2) (Fs - Fc),
and dz/dt (damping before breakaway); one law serves LuGre and Coulomb friction: at a short distance
the bristle is a sign that knows rest. On the load, the first two along its motion, which follows
from the measured one of the motor:

    J2 dw2/dt = K (theta - theta2) + D (w - w2) - F2

F2 costs the motor the torque H F2 with H = (2 za wa s + wa^2)/(s^2 + 2 za wa s + wa^2), wa and za
of the first antiresonance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from ..blocks.friction import along, level, strokes
from .mechanics import Mechanics, quadratic
from .runs import FINER, Run, Shape, Spacing, Window, means, windows, without

SPACING = Spacing(15, 0.035, 1.4)
TOP, SHARE = 40.0, 0.2  # Hz, and of the rate: friction is fitted below both, above it is weak
PASSES = 4  # of weights
FLOOR = 1e-3  # of the largest residual: no window weighs more
STEPS = (0.25, 0.12, 0.06)  # of the search, decades and samples
EARLIEST = 0.6  # samples: a motion in counts shows a reversal late, and rests hide it
MOTOR, LOAD = ("Fc", "dF", "damping"), ("load Fc", "load dF")
STEEPEST, FALLS = 1.5, 0.9  # dF/Fc: Fs up to 2.5 Fc, friction that falls by up to 90 % at low speed
COST = attrgetter("cost")
STEP = 0.3  # rad of the load's fastest oscillation in a step, at most
SHORTEST = 1e-3  # of the distance between the load's reversals: a bristle stiffer than this


Strokes = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class LoadMotion:
    """The load's path and speed (FINER n,) in the parts of intervals, and H (M,) at the bins."""

    path: Strokes
    speed: np.ndarray
    seen: np.ndarray


def load_motion(run: Run, mechanics: Mechanics, friction: float, distance: float) -> LoadMotion:
    """Compute the motion of the load, with about so much friction (N m or N) on it."""
    wa, za, ratio, _ = np.exp(mechanics.pairs[0]).tolist()
    share = 1.0 - 1.0 / (1.0 + ratio) ** 2  # of the inertia, on the load
    braking = friction / (share * mechanics.inertia[0])
    path, first, _ = run.strokes
    distance = max(distance, SHORTEST * path[-1] / max(len(first), 1))
    part = run.dt / FINER
    n_steps = math.ceil(part * max(wa, math.sqrt(braking / distance)) / STEP)
    h, k, d = part / n_steps, wa**2, 2.0 * za * wa
    x, v, z = float(run.theta[0]), 0.0, 0.0
    steps, speeds = [], []
    fine = np.arange(FINER * len(run.theta)) / FINER
    angles = np.interp(fine, np.arange(len(run.theta)), run.theta)
    for now, after in zip(angles[:-1].tolist(), angles[1:].tolist(), strict=True):
        begin, w = x, (after - now) / part
        for i in range(n_steps):
            end = math.copysign(1.0, v)
            z = end + (z - end) * math.exp(-abs(v) * h / distance)
            v += h * (k * (now + w * h * (i + 0.5) - x) + d * (w - v) - braking * z)
            x += h * v
        steps.append(x - begin)
        speeds.append(v)
    s, seen = 1j * run.w, np.array([*speeds, v])
    H = (2.0 * za * s / wa + 1.0) / quadratic(s, wa, za)
    return LoadMotion(strokes(np.array([*steps, 0.0])), seen, H)


def _terms(
    path: Strokes, speed: np.ndarray, distance: float, vs: float
) -> tuple[np.ndarray, np.ndarray]:
    """The deflection at the end of each part of an interval, and the means (n, 2) of deflection
    and Stribeck term in each interval."""
    z = along(*path, distance)
    middle = 0.5 * (z + np.append(0.0, z[:-1]))
    return z, np.stack([means(middle), means(middle * level(speed, 0.0, 1.0, vs))], axis=1)


def impossible(names: Sequence[str], levels: Sequence[float], most: float = np.inf) -> str | None:
    """Return a term to be left out, whose level no friction has: the least certain of several;
    ``most`` is the largest torque, and friction that the axis overcomes is no larger."""
    found = dict(zip(names, levels, strict=True))
    large = [k for k in ("load Fc", "Fc") if found.get(k, 0.0) > most]
    if large:
        return large[0]
    for key, change in (("load Fc", "load dF"), ("Fc", "dF")):
        whole = found.get(key, 0.0)
        if change in found and not -FALLS * whole <= found[change] <= STEEPEST * whole:
            return change
    if "damping" in found and not found.get("Fc", 0.0) > 0.0:  # of a bristle that is not there
        return "damping"
    return next((k for k in ("load Fc", "damping", "Fc") if found.get(k, 0.0) < 0.0), None)


@dataclass(frozen=True, eq=False)
class Friction:
    """The friction found: its spectrum for each run as a part of the command, N m or N.

    ``distance`` in rad or m, ``vs`` in rad/s or m/s, ``early`` in samples; ``levels`` by term, none
    where the log shows no friction; ``cost`` is the mean log residual.
    """

    spectra: tuple[np.ndarray, ...]
    levels: dict[str, float]
    distance: float
    vs: float
    early: float
    cost: float


@dataclass(frozen=True, eq=False)
class Problem:
    """What stays the same while the shapes are searched; ``advance`` (M,) of each run takes a
    torque in force to the command, ``loads`` is the motion of the load, if it has friction."""

    runs: Sequence[Run]
    advance: Sequence[np.ndarray]
    shapes: Sequence[Shape]
    windows: Sequence[Window]
    bases: Sequence[np.ndarray]
    left: Sequence[np.ndarray]
    loads: Sequence[LoadMotion] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return MOTOR + LOAD if self.loads else MOTOR

    def spectra(self, i: int, distance: float, vs: float) -> np.ndarray:
        """The terms of a run (M, m); none acts where the axis stands."""
        run = self.runs[i]
        z, made = _terms(run.strokes, run.fine_speed, distance, vs)
        made = np.c_[made, np.diff(z[FINER - 1 :: FINER], prepend=0.0) / run.dt]
        if self.loads:
            load = self.loads[i]
            far = _terms(load.path, load.speed, distance, vs)[1]
            made = np.c_[made, run.signal(run.spectrum(far) * load.seen[:, None])]
        share = run.scale * ~run.stands
        return run.spectrum(made * share[:, None]) * self.advance[i][:, None]

    def without(self, found: Friction) -> Friction:
        """The same shapes with no friction."""
        none = [np.zeros((len(y), 0)) for y in self.left]
        spectra = tuple(np.zeros_like(F) for F in found.spectra)
        return replace(found, spectra=spectra, levels={}, cost=_levels(none, self.left)[1])

    def tried(self, distance: float, vs: float, early: float) -> Friction:
        """The best levels at these shapes."""
        made = [
            self.spectra(i, distance, vs) * np.exp(1j * run.w * run.dt * early)[:, None]
            for i, run in enumerate(self.runs)
        ]
        shaped = [s.num[:, None] * F for s, F in zip(self.shapes, made, strict=True)]
        both = zip(self.bases, self.windows, strict=True)
        X = [without(Q, one.rows(shaped)) for Q, one in both]
        most = max(float(np.abs(run.u).max()) for run in self.runs)
        levels, cost = _possible(X, self.left, self.names, most)
        spectra = tuple(F @ np.array([*levels.values()]) for F in made)
        return Friction(spectra, levels, distance, vs, early, cost)


def problem_of(
    runs: Sequence[Run],
    advance: Sequence[np.ndarray],
    shapes: Sequence[Shape],
    torques: Sequence[np.ndarray],
) -> Problem:
    """Pose the problem of the spectra of the commands ``torques``."""
    every = windows(runs, 0.0, 2.0 * np.pi * min(TOP, SHARE / runs[0].dt), SPACING)
    moved = [shape.den * run.W for shape, run in zip(shapes, runs, strict=True)]
    driven = [shape.num * U for shape, U in zip(shapes, torques, strict=True)]
    bases = []
    for one in every:
        linear = one.poly * one.rows(moved)[:, None]
        linear = linear / (np.linalg.norm(linear, axis=0) + 1e-300)
        bases.append(np.linalg.qr(np.c_[linear, one.transient])[0])
    left = [without(Q, one.rows(driven)) for Q, one in zip(bases, every, strict=True)]
    return Problem(runs, advance, shapes, every, bases, left)


def fit_friction(problem: Problem, before: Friction | None = None) -> Friction:
    """The shapes with the smallest residual: from a grid, or near those before, then by steps."""
    low, high, slow, fast = _ranges(problem.runs)
    if before is None:
        distances = low * 10 ** np.arange(0.0, np.log10(high / low) + 0.01, 0.5)
        speeds = np.geomspace(slow, fast, 5)[1:-1]
        grid = [(x, v, 0.0) for x in distances.tolist() for v in speeds.tolist()]
    else:
        grid = [(before.distance, before.vs, before.early)]
    best = min((problem.tried(*shape) for shape in grid), key=COST)
    for step in STEPS if before is None else STEPS[1:]:
        for _ in range(2):
            for a, b, c in step * np.concatenate([np.eye(3), -np.eye(3)]):
                distance, vs = best.distance * 10**a, best.vs * 10**b
                early = best.early + c
                if low <= distance <= high and slow <= vs <= fast and abs(early) <= EARLIEST:
                    best = min(best, problem.tried(distance, vs, early), key=COST)
    return best


def _ranges(runs: Sequence[Run]) -> tuple[float, float, float, float]:
    """Bounds of the distance and of vs that the motion can show."""
    speed = float(np.sqrt(np.mean(np.concatenate([run.speed for run in runs]) ** 2)))
    path = max(run.strokes[0][-1] for run in runs)
    turns = max(len(run.strokes[1]) for run in runs)
    count, dt = runs[0].count, runs[0].dt
    low = max(0.7 * count, 1e-3 * speed * dt)
    return low, max(0.1 * path / max(turns, 1), 10.0 * low), 0.01 * speed, 0.5 * speed


def _possible(
    X: list[np.ndarray], y: Sequence[np.ndarray], names: Sequence[str], most: float
) -> tuple[dict[str, float], float]:
    """Levels that friction can have, and the cost; fewer terms where all together cannot."""
    kept = list(names)
    while True:
        at = [names.index(k) for k in kept]
        levels, cost = _levels([x[:, at] for x in X], y)
        wrong = impossible(kept, levels.tolist(), most)
        if wrong is None:
            return {k: 0.0 for k in names} | dict(zip(kept, levels.tolist(), strict=True)), cost
        kept.remove(wrong)


def _levels(X: list[np.ndarray], y: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Real coefficients common to all windows, weighted by what each window leaves."""
    sizes = np.array([len(one) for one in y])
    A, b = np.concatenate(X), np.concatenate(y)
    A, b = (np.concatenate([np.real(x), np.imag(x)]) for x in (A, b))
    at = np.repeat(np.arange(len(sizes)), sizes)
    levels, left = np.zeros(A.shape[1]), np.ones(len(sizes))
    scale = left
    for _ in range(PASSES):
        weight = np.tile((1.0 / scale)[at], 2)
        if A.shape[1]:
            levels = np.linalg.lstsq(A * weight[:, None], b * weight, rcond=None)[0]
        square = (b - A @ levels) ** 2
        square = square[: len(at)] + square[len(at) :]
        left = np.sqrt(np.bincount(at, square) / sizes) + 1e-300
        scale = np.maximum(left, FLOOR * left.max())
    return levels, float(sizes @ np.log(left) / sizes.sum())
