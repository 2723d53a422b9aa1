"""Runs at steady speed: a run is one point of the friction curve.

    y_ij = x_ij p + b_i + e_ij,    b_i of variance v_b,    e_ij of variance v_w

for window j of run i. All windows of a run have its own scatter ``b_i``, so of friction, which is
one value in a run, they tell no more than their mean. What changes along a run, as gravity does,
shows in the differences as well. Both variances are residuals over what the values leave free
(REML): ``v_b = sum rbar_i^2 / (n - trace H)``, where H is the leverage of the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from .constants import (
    CONFIDENCE,
    DIP_OF_MAP,
    DIP_SPEEDS,
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
from .friction_shapes import Dip
from .interval import of_scale
from .problem import Ground
from .result import CurvePoint
from .terms import Term
from .windows import Windows

AS_MANY = (
    "{} runs at steady speed are {} points of the friction curve, and as many values are fitted to "
    "them: nothing is left to tell their errors, so they have no intervals. Record more speeds, or "
    "the same ones again."
)


@dataclass(frozen=True, eq=False)
class Rows:
    """Means of the runs, and differences from them in the windows, each counted ``share`` times.

    ``place`` is the run of each window.
    """

    place: np.ndarray
    y: np.ndarray
    X: np.ndarray
    apart_y: np.ndarray
    apart_X: np.ndarray
    share: float

    @classmethod
    def of(cls, d: Windows, X: np.ndarray, share: float = 1.0 / OVERLAP) -> Rows:
        place = places(d)
        size = np.bincount(place)
        y = np.bincount(place, d.y) / size
        mean = np.column_stack([np.bincount(place, x) / size for x in X.T])
        return cls(place, y, mean, d.y - y[place], X - mean[place], share)

    @property
    def free_apart(self) -> float:
        """Independent differences."""
        return self.share * (len(self.place) - len(self.y))


@dataclass(frozen=True, eq=False)
class Pointwise:
    """Values ``p`` with covariance ``V``; variances of means and differences, and what is left
    ``free`` of the means."""

    p: np.ndarray
    V: np.ndarray
    means: float
    apart: float
    free: float
    A: np.ndarray
    left: float


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
    B, W = rows.X.T @ rows.X, share * rows.apart_X.T @ rows.apart_X
    b, c = rows.X.T @ rows.y, share * rows.apart_X.T @ rows.apart_y
    means = float(np.var(rows.y)) + least**2
    apart = share * float(rows.apart_y @ rows.apart_y) / max(rows.free_apart, 1.0) + least**2
    for _ in range(ROUNDS_OF_SCATTER):
        A = B / means + W / apart + P
        V = np.linalg.inv(A)
        p = V @ (b / means + c / apart)
        r, s = rows.y - rows.X @ p, rows.apart_y - rows.apart_X @ p
        free = n - float(np.sum(V * B)) / means
        left = float(r @ r)
        next_means = left / max(free, 0.5) + least**2
        within = rows.free_apart - float(np.sum(V * W)) / apart
        next_apart = share * float(s @ s) / max(within, 1.0) + least**2
        settled = abs(next_means / means - 1) < SETTLED and abs(next_apart / apart - 1) < SETTLED
        means, apart = next_means, next_apart
        if settled:
            break
    return Pointwise(p, V, means, apart, free, A, left)


@dataclass(frozen=True, eq=False)
class OfRuns:
    """The fit of a map, its covariance, the ``scatter`` of a run, N m, and the degrees of freedom;
    0 where nothing is left."""

    fit: Fit
    V: np.ndarray
    scatter: float
    freedom: float
    notes: tuple[str, ...] = ()


def of_runs(ground: Ground, made: Fit) -> OfRuns:
    """What the runs say, each one point; averaged over what friction may do at low speed."""
    least = FLOOR_OF_FRICTION * made.problem.level
    X, prior = made.windows.X, made.problem.prior
    rows = Rows.of(made.windows, X)
    plain = points(rows, prior, least)
    rows = replace(rows, share=1.0 / max(OVERLAP, memory(rows.apart_y - rows.apart_X @ plain.p)))
    plain = points(rows, prior, least)
    n = len(rows.y)
    if plain.free < 0.5:
        only = plain.V @ np.diag(1.0 / prior**2) @ plain.V  # what no run shows
        return OfRuns(_as_fit(made, rows, plain.p, X), only, 0.0, 0.0, (AS_MANY.format(n, n),))
    shapes, tried = _dips(ground, made, rows, plain, least)
    p, V, best = _averaged(plain, tried)
    if best is not None:
        made, X = _beside(made, *shapes[best])
        dip = tried[best][0]
        p = np.append(p, dip.p[-1])
        V = np.block([[V, np.zeros((len(V), 1))], [np.zeros((1, len(V))), dip.V[-1:, -1:]]])
    done = _as_fit(made, rows, p, X)
    V = V + of_scale(ground.source, ground.travel, done)
    return OfRuns(done, V, float(np.sqrt(plain.means)), plain.free)


def curve_of_runs(found: OfRuns) -> tuple[CurvePoint, ...]:
    """The friction torque of each run over its speed, with the scatter of the runs."""
    made, place = found.fit, found.fit.chunks[0]
    torque, many = friction_torque(made), np.bincount(place)
    half = float(student.ppf(0.5 + CONFIDENCE / 2, max(found.freedom, 1.0))) * found.scatter
    rows = zip(np.bincount(place, made.windows.w) / many, np.bincount(place, torque) / many, many,
               strict=True)  # fmt: skip
    ends = (lambda y: (y - half, y + half)) if found.freedom else lambda _: None
    return tuple(CurvePoint(float(w), float(y), ends(float(y)), int(n)) for w, y, n in sorted(rows))


def _dips(
    ground: Ground, made: Fit, rows: Rows, plain: Pointwise, least: float
) -> tuple[list[tuple[Term, np.ndarray]], list[tuple[Pointwise, float]]]:
    """Friction that falls with speed (Stribeck): each shape, its fit and its share of belief."""
    if "Fc" not in made.names:
        return [], []
    lowest = max(0.5 * float(np.min(np.abs(made.windows.w))), SLOWEST_DIP * ground.speed)
    speeds = np.geomspace(lowest, max(0.25 * ground.speed, 1.01 * lowest), DIP_SPEEDS)
    terms = [Term("dip", Dip(float(v), n), friction=True) for v in speeds for n in (1, 2)]
    all_of = ground.source.windows(made.half_width, terms, made.setting.rest, made.delay)
    if all_of is None:
        return [], []
    size = DIP_OF_MAP * made.problem.level
    shapes, tried = [], []
    for term, column in zip(terms, all_of.X.T, strict=True):
        if np.abs(column).max() <= LEAST_COLUMN:
            continue
        own = Rows.of(made.windows, np.c_[made.windows.X, column], rows.share)
        dip = points(own, np.append(made.problem.prior, size), least)
        shapes.append((term, column))
        tried.append((dip, _belief(dip, plain, size, len(rows.y) * least**2)))
    return shapes, tried


def _belief(dip: Pointwise, plain: Pointwise, size: float, floor: float) -> float:
    """Log of the evidence for a dip over none, the scatter of the runs integrated out.

    The dip has a normal prior of ``size``, above 0: no law has a negative one.
    """
    d, sd = float(dip.p[-1]), float(np.sqrt(dip.V[-1, -1]))
    left = dip.left + floor + dip.means * (d / size) ** 2
    fits = 0.5 * plain.free * np.log((plain.left + floor) / left)
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
    return replace(made, p=p, solution=replace(made.solution, p=p, r=r), chunks=[rows.place])
