"""Runs at steady speed: a run is one point of the friction curve.

    y_ij = x_ij p + b_i + e_ij,    b_i of variance v_b,    e_ij of variance v_w

for window j of run i. All windows of a run have its own scatter ``b_i``, so of friction, which is
one value in a run, they tell no more than their mean, whose error they show besides. What changes
along a run, as gravity does, shows in the differences as well. The variances are residuals over
what the values leave free (REML; Paule and Mandel, 1982): with ``g_i = 1 / (v_b + own_i)``,
``sum g_i rbar_i^2 = n - trace H``, where H is the leverage of the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from ...core.numeric import rms
from .constants import (
    BEND_OF_MAP,
    DIP_OF_MAP,
    LITTLE,
    NOTHING,
    PASSES,
    RARE,
    SLOWEST_DIP,
    SMALL,
    STEP,
    TILT_OF_MAP,
    TOP,
)
from .covariance import memory
from .fit import Fit
from .friction_curve import friction_torque
from .friction_shapes import dips
from .interval import of_scale
from .problem import Ground
from .result import CurvePoint
from .terms import Term, drag, tilt
from .windows import Windows

SAME = 1e-6  # of a column, to which rounding leaves of it what is another already
AS_MANY = (
    "{} runs at steady speed are {} points of the friction curve, and as many values are fitted to "
    "them: nothing is left to tell their errors, so they have no intervals. Record more speeds, or "
    "the same ones again."
)


@dataclass(frozen=True, eq=False)
class Rows:
    """Means of the runs, and differences from them in the windows, each counted ``share`` times.

    ``place`` is the run of each window, ``own`` the variance of the mean of a run by its windows.
    """

    place: np.ndarray
    y: np.ndarray
    X: np.ndarray
    apart_y: np.ndarray
    apart_X: np.ndarray
    share: float
    own: np.ndarray

    @classmethod
    def of(cls, d: Windows, X: np.ndarray, share: float = STEP, own: Any = 0.0) -> Rows:
        place = places(d)
        y, mean = _means(place, d.y), np.column_stack([_means(place, x) for x in X.T])
        return cls(place, y, mean, d.y - y[place], X - mean[place], share, own + 0.0 * y)

    def noisy(self, p: np.ndarray) -> Rows:
        """With the memory and the errors of the means that these values leave in the runs."""
        s = self.apart_y - self.apart_X @ p
        many = np.bincount(self.place)
        each = np.bincount(self.place, s**2) / np.maximum(many - 1, 1)
        own = each / np.maximum(many * STEP, 1.0)
        return replace(self, share=min(STEP, 1.0 / memory(s)), own=own)


@dataclass(frozen=True, eq=False)
class Pointwise:
    """Values ``p`` with covariance ``V``; the weights ``g`` of the means, what is left ``free`` of
    them, and their residuals ``r``."""

    p: np.ndarray
    V: np.ndarray
    g: np.ndarray
    free: float
    r: np.ndarray


@dataclass(frozen=True, eq=False)
class OfRuns:
    """The fit of a map, its covariance, the ``scatter`` of each run, N m, and the degrees of
    freedom; 0 where nothing is left."""

    fit: Fit
    V: np.ndarray
    scatter: np.ndarray
    freedom: float
    notes: tuple[str, ...] = ()

    def curve(self) -> tuple[CurvePoint, ...]:
        """The friction torque of each run over its speed, with the scatter of the runs."""
        place, many = self.fit.chunks[0], np.bincount(self.fit.chunks[0])
        half = student.ppf(0.5 + TOP / 2, max(self.freedom, 1.0)) * self.scatter
        w, y = (_means(place, x) for x in (self.fit.windows.w, friction_torque(self.fit)))
        ends = [(float(a), float(b)) if self.freedom else None
                for a, b in zip(y - half, y + half, strict=True)]  # fmt: skip
        order = np.argsort(w).tolist()
        return tuple(CurvePoint(float(w[i]), float(y[i]), ends[i], int(many[i])) for i in order)


def _means(place: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.bincount(place, x) / np.bincount(place)


def places(d: Windows) -> np.ndarray:
    """The point of each window (n,): its run; pieces of a log at other speeds are other points."""
    made, seen = np.zeros(len(d.y), int), []
    for piece in np.unique(d.piece):
        at = d.piece == piece
        run, w = d.run[at][0], float(np.median(d.w[at]))
        alike = [i for i, (r, v) in enumerate(seen) if r == run and abs(v - w) < LITTLE * abs(v)]
        seen += [] if alike else [(run, w)]
        made[at] = alike[0] if alike else len(seen) - 1
    return made


def points(rows: Rows, prior: np.ndarray, least: float) -> Pointwise:
    """The values, by least squares of means and differences, with their variances in turn.

    ``prior`` (m,) are standard deviations of the values around 0, ``least`` that of a mean.
    """
    n, P, share = len(rows.y), np.diag(1.0 / prior**2), rows.share
    W, c = share * rows.apart_X.T @ rows.apart_X, share * rows.apart_X.T @ rows.apart_y
    differences = share * (len(rows.place) - n)  # the independent ones
    means = float(np.var(rows.y)) + least**2
    apart = share * float(rows.apart_y @ rows.apart_y) / max(differences, 1.0) + least**2
    for _ in range(4 * PASSES):
        g = 1.0 / (means + rows.own)
        B = rows.X.T @ (g[:, None] * rows.X)
        V = np.linalg.inv(B + W / apart + P)
        p = V @ (rows.X.T @ (g * rows.y) + c / apart)
        r, s = rows.y - rows.X @ p, rows.apart_y - rows.apart_X @ p
        free = n - float(np.sum(V * B))
        beyond = float(g**2 @ (r**2 * n / max(free, 0.5) - rows.own)) / float(g @ g)
        within = differences - float(np.sum(V * W)) / apart
        before = means, apart
        means = max(beyond, 0.0) + least**2
        apart = share * float(s @ s) / max(within, 1.0) + least**2
        if abs(means / before[0] - 1) < RARE and abs(apart / before[1] - 1) < RARE:
            break
    return Pointwise(p, V, g, free, r)


def of_runs(ground: Ground, made: Fit) -> OfRuns:
    """What the runs say, each one point; averaged over what friction may do beside Fc and Fv."""
    least = NOTHING * made.problem.level
    X, prior = made.windows.X, made.problem.prior
    rows = Rows.of(made.windows, X)
    rows = rows.noisy(points(rows, prior, least).p)
    plain = points(rows, prior, least)
    if plain.free < 0.5:
        only = plain.V @ np.diag(1.0 / prior**2) @ plain.V  # what no run shows
        note, n = AS_MANY, len(rows.y)
        return OfRuns(_as_fit(made, rows, plain.p), only, plain.g**-0.5, 0.0, (note.format(n, n),))
    p, V, taken = _averaged(plain, _shapes(ground, made, rows, plain, least))
    if taken is not None:
        column = taken.column
        windows = replace(made.windows, X=np.c_[X, column])
        terms, size = (*made.terms, taken.term), np.append(made.rms, rms(column))
        made = replace(made, terms=terms, windows=windows, rms=size)
        p = np.append(p, taken.fit.p[-1])
        V = np.pad(V, (0, 1))
        V[-1, -1] = taken.fit.V[-1, -1]
    done = _as_fit(made, rows, p)
    V = V + of_scale(ground.source, ground.travel, done)
    return OfRuns(done, V, plain.g**-0.5, plain.free)


@dataclass(frozen=True, eq=False)
class Shape:
    """What friction may do beside its level: term, column, fit, and log of the evidence for it."""

    term: Term
    column: np.ndarray
    fit: Pointwise
    belief: float


def _shapes(ground: Ground, made: Fit, rows: Rows, plain: Pointwise, least: float) -> list[Shape]:
    """Friction that falls with speed (Stribeck), bends upwards (drag) or is steeper one way. A law
    without the bend of a map would count it as scatter of the runs, and call certain what only that
    law says."""
    if "Fc" not in made.names:
        return []
    lowest = max(0.5 * float(np.min(np.abs(made.windows.w))), SLOWEST_DIP * ground.speed)
    sizes = dict.fromkeys(dips(ground.speed, lowest), DIP_OF_MAP * made.problem.level)
    if "Fv" in made.names:
        sizes[Term("dip", drag(ground.speed), friction=True)] = BEND_OF_MAP * rms(rows.y)
        steeper = (Term("tilt", tilt(way * ground.speed), friction=True) for way in (1.0, -1.0))
        sizes |= dict.fromkeys(steeper, TILT_OF_MAP * rms(rows.y))
    all_of = ground.source.windows(made.half_width, [*sizes], made.setting.rest, made.delay)
    columns, found, X = [] if all_of is None else all_of.X.T, [], made.windows.X
    for (term, size), column in zip(sizes.items(), columns, strict=False):
        beyond = column - X @ np.linalg.lstsq(X, column, rcond=None)[0]
        if np.abs(column).max() <= SMALL or rms(beyond) < SAME * rms(column):
            continue  # the terms are the column already, as a declared drag is the bend
        own = Rows.of(made.windows, np.c_[X, column], rows.share, rows.own)
        shaped = points(own, np.append(made.problem.prior, size), least)
        found.append(Shape(term, column, shaped, _belief(shaped, plain, size, least)))
    return found


def _belief(dip: Pointwise, plain: Pointwise, size: float, least: float) -> float:
    """Log of the evidence for a dip over none, the scatter of the runs integrated out.

    The dip has a normal prior of ``size``, above 0: no law has a negative one.
    """
    d, sd = float(dip.p[-1]), float(np.sqrt(dip.V[-1, -1]))
    floor = float(plain.g.sum()) * least**2
    before = float(plain.g @ plain.r**2) + floor
    after = float(plain.g @ dip.r**2) + floor + (d / size) ** 2
    fits = 0.5 * plain.free * np.log(before / after)
    return float(fits + np.log(sd / size) + np.log(2.0) + norm.logcdf(d / sd))


def _averaged(
    plain: Pointwise, shapes: Sequence[Shape]
) -> tuple[np.ndarray, np.ndarray, Shape | None]:
    """Mean and covariance over the shapes, and the most credible one; None is the plain one.

    With and without a shape are equally likely beforehand.
    """
    m, every = len(plain.p), [plain, *(shape.fit for shape in shapes)]
    log = np.array([0.0, *(shape.belief - np.log(len(shapes)) for shape in shapes)])
    share = np.exp(log - log.max())
    share /= share.sum()
    values = np.array([one.p[:m] for one in every])
    p = share @ values
    gap = values - p
    V = np.einsum("i,ijk->jk", share, np.array([one.V[:m, :m] for one in every]))
    V = V + (share[:, None] * gap).T @ gap
    best = max(shapes, key=lambda shape: shape.belief, default=None)
    return p, V, best if share[1:].sum() > share[0] else None


def _as_fit(made: Fit, rows: Rows, p: np.ndarray) -> Fit:
    solution = replace(made.solution, p=p, r=made.windows.y - made.windows.X @ p)
    return replace(made, p=p, solution=solution, chunks=[rows.place], of_runs=True)
