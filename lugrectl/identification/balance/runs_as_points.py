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
    CONFIDENCE,
    DIP_OF_MAP,
    FLOOR_OF_FRICTION,
    LEAST_COLUMN,
    OVERLAP,
    ROUNDS_OF_SCATTER,
    SETTLED,
    SLOWEST_DIP,
    STEADY,
)
from .covariance import memory
from .fit import Fit
from .friction_curve import friction_torque
from .friction_shapes import dips
from .interval import of_scale
from .problem import Ground
from .result import CurvePoint
from .terms import Term, drag
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
    def of(cls, d: Windows, X: np.ndarray, share: float = 1.0 / OVERLAP, own: Any = None) -> Rows:
        place = places(d)
        size = np.bincount(place)
        y = np.bincount(place, d.y) / size
        mean = np.column_stack([np.bincount(place, x) / size for x in X.T])
        own = np.zeros(len(y)) if own is None else own
        return cls(place, y, mean, d.y - y[place], X - mean[place], share, own)

    def noisy(self, p: np.ndarray) -> Rows:
        """With the memory and the errors of the means that these values leave in the runs."""
        s = self.apart_y - self.apart_X @ p
        share, many = 1.0 / max(OVERLAP, memory(s)), np.bincount(self.place)
        each = np.bincount(self.place, s**2) / np.maximum(many - 1, 1)
        return replace(self, share=share, own=each / np.maximum(many / OVERLAP, 1.0))

    @property
    def free_apart(self) -> float:
        """Independent differences."""
        return self.share * (len(self.place) - len(self.y))


@dataclass(frozen=True, eq=False)
class Pointwise:
    """Values ``p`` with covariance ``V``; the variance of a run beyond its own error, the weights
    ``g`` of the means, what is left ``free`` of them, and their residuals ``r``."""

    p: np.ndarray
    V: np.ndarray
    means: float
    g: np.ndarray
    free: float
    r: np.ndarray


def places(d: Windows) -> np.ndarray:
    """The point of each window (n,): its run; pieces of a log at other speeds are other points."""
    made, seen = np.zeros(len(d.y), int), []
    for piece in np.unique(d.piece):
        at = d.piece == piece
        run, w = d.run[at][0], float(np.median(d.w[at]))
        alike = [i for i, (r, v) in enumerate(seen) if r == run and abs(v - w) < STEADY * abs(v)]
        seen += [] if alike else [(run, w)]
        made[at] = alike[0] if alike else len(seen) - 1
    return made


def points(rows: Rows, prior: np.ndarray, least: float) -> Pointwise:
    """The values, by least squares of means and differences, with their variances in turn.

    ``prior`` (m,) are standard deviations of the values around 0, ``least`` that of a mean.
    """
    n, m = rows.X.shape
    P, share = np.diag(1.0 / prior**2), rows.share
    W, c = share * rows.apart_X.T @ rows.apart_X, share * rows.apart_X.T @ rows.apart_y
    means = float(np.var(rows.y)) + least**2
    apart = share * float(rows.apart_y @ rows.apart_y) / max(rows.free_apart, 1.0) + least**2
    for _ in range(ROUNDS_OF_SCATTER):
        g = 1.0 / (means + rows.own)
        B = rows.X.T @ (g[:, None] * rows.X)
        V = np.linalg.inv(B + W / apart + P)
        p = V @ (rows.X.T @ (g * rows.y) + c / apart)
        r, s = rows.y - rows.X @ p, rows.apart_y - rows.apart_X @ p
        free = n - float(np.sum(V * B))
        beyond = float(g**2 @ (r**2 * n / max(free, 0.5) - rows.own)) / float(g @ g)
        next_means = max(beyond, 0.0) + least**2
        within = rows.free_apart - float(np.sum(V * W)) / apart
        next_apart = share * float(s @ s) / max(within, 1.0) + least**2
        settled = abs(next_means / means - 1) < SETTLED and abs(next_apart / apart - 1) < SETTLED
        means, apart = next_means, next_apart
        if settled:
            break
    return Pointwise(p, V, means, g, free, r)


@dataclass(frozen=True, eq=False)
class OfRuns:
    """The fit of a map, its covariance, the ``scatter`` of each run, N m, and the degrees of
    freedom; 0 where nothing is left."""

    fit: Fit
    V: np.ndarray
    scatter: np.ndarray
    freedom: float
    notes: tuple[str, ...] = ()


def of_runs(ground: Ground, made: Fit) -> OfRuns:
    """What the runs say, each one point; averaged over what friction may do beside Fc and Fv."""
    least = FLOOR_OF_FRICTION * made.problem.level
    X, prior = made.windows.X, made.problem.prior
    rows = Rows.of(made.windows, X)
    plain = points(rows, prior, least)
    rows = rows.noisy(plain.p)
    plain = points(rows, prior, least)
    n = len(rows.y)
    if plain.free < 0.5:
        only = plain.V @ np.diag(1.0 / prior**2) @ plain.V  # what no run shows
        return OfRuns(
            _as_fit(made, rows, plain.p, X), only, plain.g**-0.5, 0.0, (AS_MANY.format(n, n),)
        )
    shapes, tried = _shapes(ground, made, rows, plain, least)
    p, V, best = _averaged(plain, tried)
    if best is not None:
        made, X = _beside(made, *shapes[best])
        dip = tried[best][0]
        p = np.append(p, dip.p[-1])
        V = np.block([[V, np.zeros((len(V), 1))], [np.zeros((1, len(V))), dip.V[-1:, -1:]]])
    done = _as_fit(made, rows, p, X)
    V = V + of_scale(ground.source, ground.travel, done)
    return OfRuns(done, V, plain.g**-0.5, plain.free)


def curve_of_runs(found: OfRuns) -> tuple[CurvePoint, ...]:
    """The friction torque of each run over its speed, with the scatter of the runs."""
    made, place = found.fit, found.fit.chunks[0]
    torque, many = friction_torque(made), np.bincount(place)
    half = float(student.ppf(0.5 + CONFIDENCE / 2, max(found.freedom, 1.0))) * found.scatter
    w, y = np.bincount(place, made.windows.w) / many, np.bincount(place, torque) / many
    ends = [(float(a), float(b)) if found.freedom else None
            for a, b in zip(y - half, y + half, strict=True)]  # fmt: skip
    order = np.argsort(w).tolist()
    return tuple(CurvePoint(float(w[i]), float(y[i]), ends[i], int(many[i])) for i in order)


def _shapes(
    ground: Ground, made: Fit, rows: Rows, plain: Pointwise, least: float
) -> tuple[list[tuple[Term, np.ndarray]], list[tuple[Pointwise, float]]]:
    """Friction that falls with speed (Stribeck) or bends upwards (drag): each shape, its fit and
    its share of belief. A law without the bend of a map would count it as scatter of the runs, and
    call certain what only that law says."""
    if "Fc" not in made.names:
        return [], []
    lowest = max(0.5 * float(np.min(np.abs(made.windows.w))), SLOWEST_DIP * ground.speed)
    terms = list(dips(ground.speed, lowest))
    drags = [Term("dip", drag(ground.speed), friction=True)] if "Fv" in made.names else []
    terms += drags
    all_of = ground.source.windows(made.half_width, terms, made.setting.rest, made.delay)
    if all_of is None:
        return [], []
    fall, bend = DIP_OF_MAP * made.problem.level, BEND_OF_MAP * rms(rows.y)
    shapes, tried = [], []
    for term, column in zip(terms, all_of.X.T, strict=True):
        if np.abs(column).max() <= LEAST_COLUMN or _inside(made.windows.X, column):
            continue
        size = bend if term in drags else fall
        own = Rows.of(made.windows, np.c_[made.windows.X, column], rows.share, rows.own)
        dip = points(own, np.append(made.problem.prior, size), least)
        shapes.append((term, column))
        tried.append((dip, _belief(dip, plain, size, least)))
    return shapes, tried


def _inside(X: np.ndarray, column: np.ndarray) -> bool:
    """Whether the terms are the column already, as a declared drag is the bend."""
    beyond = column - X @ np.linalg.lstsq(X, column, rcond=None)[0]
    return rms(beyond) < SAME * rms(column)


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
    plain: Pointwise, tried: Sequence[tuple[Pointwise, float]]
) -> tuple[np.ndarray, np.ndarray, int | None]:
    """Mean and covariance over the shapes, and the most credible one; None is the plain one.

    With and without a dip are equally likely beforehand.
    """
    if not tried:
        return plain.p, plain.V, None
    m = len(plain.p)
    log = np.array([0.0, *(belief - np.log(len(tried)) for _, belief in tried)])
    share = np.exp(log - log.max())
    share /= share.sum()
    values = np.array([plain.p, *(one.p[:m] for one, _ in tried)])
    p = share @ values
    gap = values - p
    own = [plain.V, *(one.V[:m, :m] for one, _ in tried)]
    V = np.einsum("i,ijk->jk", share, np.array(own)) + (share[:, None] * gap).T @ gap
    best = int(np.argmax(share[1:]))
    return p, V, best if share[1:].sum() > share[0] else None


def _beside(made: Fit, term: Term, column: np.ndarray) -> tuple[Fit, np.ndarray]:
    """The fit with a dip as its last term."""
    X = np.c_[made.windows.X, column]
    rms = np.append(made.rms, np.sqrt(np.mean(column**2)))
    terms = (*made.terms, term)
    return replace(made, terms=terms, windows=replace(made.windows, X=X), rms=rms), X


def _as_fit(made: Fit, rows: Rows, p: np.ndarray, X: np.ndarray) -> Fit:
    r = made.windows.y - X @ p
    return replace(
        made, p=p, solution=replace(made.solution, p=p, r=r), chunks=[rows.place], of_runs=True
    )
