"""The declared model at its most likely presliding distance and Stribeck speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..regression.numbers import LEAST
from ..regression.robust_regression import Scale, likelihood, solve, weights
from .base_model import LEAST_FRICTION, LEVELS, SLIGHT, WIDE, Base, Columns, Record, View, rms
from .declared_effects import terms
from .friction_terms import NAMES, SMEAR
from .rests import peaks, rests_of

STEPS = (1.4, 1.2, 1.1, 1.05)  # of the presliding distance and the Stribeck speed, after the grid


def settled(
    record: Record,
    view: View | None = None,
    gravity: bool = False,
    beside: Columns | None = None,
    u: np.ndarray | None = None,
) -> Base:
    """The declared model at its most likely presliding distance and Stribeck speed.

    ``beside``: with the terms of the likeliest effect in the model while these are chosen; ``u``:
    with its torque. The base that is returned has neither.
    """
    m = record.motion
    gravity = gravity or record.turning
    own = record.u if u is None else u
    y = record.driving(own)
    shared = _shared(record, gravity)
    late = record.mean(m.slope(own))
    scale, size, weight = _sizes(record, y, late, shared)
    view, near = view or View(scale), None

    def likely(x0: float, vs: float) -> float:
        nonlocal near, weight
        columns = _columns(record, (x0, vs), late, shared, rms(y), size)
        c = columns if beside is None else columns + beside
        made = solve(c.X, y, c.prior, c.low, c.high, view.scale, weight, rounds=3, near=near)
        near, weight = made.state, made.weight
        return likelihood(made.r)

    grid = [(float(x), float(v)) for x in record.laws.distances() for v in record.laws.speeds()]
    at = likeliest(likely, grid)
    late = record.mean(m.slope(record.u))
    columns = _columns(record, at, late, shared, rms(record.driving(record.u)), size)
    law = record.once(("chosen", *at), None, lambda: record.laws.law(*at))
    return Base(record, law, columns, record.u, view, gravity=gravity)


def likeliest(
    likely: Callable[[float, float], float],
    grid: Sequence[tuple[float, float]],
) -> tuple[float, float]:
    """The best of a grid, then of finer steps around it in either direction."""
    tried = {at: likely(*at) for at in grid}
    x0, vs = max(tried, key=lambda one: tried[one])
    for r in STEPS:
        for near in ([(x0, vs / r), (x0, vs * r)], [(x0 / r, vs), (x0 * r, vs)]):
            tried |= {one: likely(*one) for one in near if one not in tried}
            x0, vs = max([(x0, vs), *near], key=lambda one: tried[one])
    return x0, vs


def columns_at(base: Base, at: tuple[float, float]) -> Columns:
    """The columns of a base at another presliding distance and Stribeck speed."""
    record = base.record
    own = record.once(("law", *at), None, lambda: _of_law(record, *at))
    X, k = base.columns.X.copy(), len(NAMES)
    after = LEVELS.stop + len(SLIGHT) + 2 * base.gravity + len(np.unique(record.motion.run)) - 1
    X[:, LEVELS] = own[:, :k]
    X[:, after : after + own.shape[1] - k] = own[:, k:]
    return replace(base.columns, X=X)


def relaid(base: Base, at: tuple[float, float]) -> Base:
    """A base at another presliding distance and Stribeck speed; its effects stay as they are."""
    record = base.record
    law = record.once(("chosen", *at), None, lambda: record.laws.law(*at))
    columns = columns_at(base, at)
    return replace(base, law=law, columns=columns, friction=base.friction_rms)


def along(base: Base, record: Record) -> Base:
    """A base along another motion; the columns of effects that are in it stay as they are."""
    X = base.columns.X.copy()
    law = record.laws.law(base.law.x0, base.law.vs)
    shared = _shared(record, base.gravity)
    X[:, 0] = record.rows.a
    X[:, LEVELS] = record.mean(law.shapes)
    X[:, LEVELS.stop : LEVELS.stop + shared.shape[1]] = shared
    columns = replace(base.columns, X=X)
    return replace(base, record=record, law=law, columns=columns, friction=base.friction_rms)


def _shared(record: Record, gravity: bool) -> np.ndarray:
    """Terms that do not depend on the law: what every drive has of an offset and of a wave a turn,
    gravity, an offset for each run after the first."""
    m = record.motion
    wave = [np.sin(m.theta), np.cos(m.theta)]
    zero = np.zeros(len(m))
    slight = [zero if m.one_way else zero + 1.0]
    slight += [zero, zero] if gravity or m.motion == "linear" else wave
    offsets = [(m.run == r).astype(float) for r in np.unique(m.run)[1:]]
    return record.mean(np.column_stack([*slight, *(wave if gravity else []), *offsets]))


def _of_law(record: Record, x0: float, vs: float) -> np.ndarray:
    """The shapes of friction, what each further run has more of it (another warmth), a peak after
    each rest, and the declared effects, in the windows."""
    law, m = record.laws.law(x0, vs), record.motion
    warmth = [(m.run == r) * x for r in np.unique(m.run)[1:] for x in (law.z, m.w)]
    peak = peaks(m, x0, rests_of(m, vs))
    more = terms(record.parts, law, m, m.d)
    return record.mean(np.column_stack([law.shapes, *warmth, peak, *more]))


def _columns(
    record: Record,
    at: tuple[float, float],
    late: np.ndarray,
    shared: np.ndarray,
    torque: float,
    friction: float = np.inf,
) -> Columns:
    """The base at a presliding distance and Stribeck speed; what every drive has is small beside
    ``friction``."""
    own = record.once(("law", *at), None, lambda: _of_law(record, *at))
    k = len(NAMES)
    X = np.column_stack([record.rows.a, late, own[:, :k], shared, own[:, k:]])
    k = X.shape[1]
    prior = np.mean(X**2, axis=0) / (WIDE * torque + 1e-300) ** 2
    prior[0], prior[1] = 0.0, 0.1 / min(record.lateness, 1.0) ** 2
    low, high = np.full(k, -np.inf), np.full(k, np.inf)
    low[LEVELS] = 0.0
    low[2 + NAMES.index(SMEAR[1])] = -np.inf
    if record.motion.one_way:
        low[2] = -np.inf  # one direction only: Coulomb friction and an offset are one term
    low[0], high[0] = record.J or (0.0, np.inf)
    low[1], high[1] = record.earliest, record.latest
    low[SLIGHT], high[SLIGHT] = -LEAST * friction, LEAST * friction
    return Columns(X, prior, low, high)


def _sizes(
    record: Record, y: np.ndarray, late: np.ndarray, shared: np.ndarray
) -> tuple[Scale, float, np.ndarray]:
    """Scale of the residual, RMS friction torque and weights, roughly: beside the first law."""
    first = float(record.laws.distances()[0]), float(record.laws.speeds()[0])
    X = _columns(record, first, late, shared, rms(y)).X
    b = np.linalg.lstsq(X, y, rcond=None)[0]
    r = y - X @ b
    sigma = max(1.4826 * float(np.median(np.abs(r))), 1e-12 * rms(y) + 1e-300)
    friction = max(rms(X[:, LEVELS] @ b[LEVELS]), LEAST_FRICTION * rms(y))
    return Scale(sigma, float(np.mean(record.rows.shake**2))), friction, weights(r / sigma)
