"""Friction laws as rows of the table: what the record needs and the declared law does not have.

All shapes of friction stay in the base while effects are judged. Here one part of them at a time is
taken out again, the presliding distance and the Stribeck speed chosen anew without it; if left-out
blocks are then predicted worse, the part is needed. Where the declared law has no such part, it is
named as an effect: ``stribeck``, ``presliding``, ``sublinear_viscous``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..regression.robust_regression import likelihood
from .base_model import LEVELS, Base, rms
from .candidate import Contender, Entry
from .friction_shape import columns_at, likeliest, relaid
from .friction_terms import FORCES, NAMES, Law
from .start_values import bristle

RIGID = 1e-3  # of the shortest presliding distance: no bristles to see
EXPONENTS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)  # of grease


@dataclass(frozen=True)
class Part:
    """A part of friction: the effect that it is, its shapes, the parameter that declares it."""

    name: str
    shapes: tuple[str, ...]
    parameter: str


PARTS = (
    Part("stribeck", FORCES[1:], "Fs"),
    Part("presliding", (), "sigma0"),
    Part("sublinear_viscous", ("grease", "slow Fv"), "exponent"),
)


def rows(base: Base) -> Iterator[Contender]:
    """A row for each part that neither the declared law nor a declared effect has; its base is the
    one without it."""
    whole = max([base, without(base, [])], key=lambda b: likelihood(b.made.r))
    declared = {one.block.name for one in base.record.parts}
    for part in PARTS:
        if part.parameter not in base.record.has and part.name not in declared:
            yield _row(base, whole, part)


def without(base: Base, parts: Sequence[Part]) -> Base:
    """The base without some parts of friction, settled again."""
    laws = base.record.laws
    gone = [NAMES.index(k) for part in parts for k in part.shapes]
    rigid = any(part.name == "presliding" for part in parts)
    distances = [RIGID * laws.distances()[0]] if rigid else laws.distances()

    def likely(x0: float, vs: float) -> float:
        return likelihood(_at(base, (x0, vs), gone).made.r)

    grid = [(float(x0), float(vs)) for x0 in distances for vs in laws.speeds()]
    at = likeliest(likely, grid if parts else [(base.law.x0, base.law.vs)])
    return replace(_at(base, at, gone), law=relaid(base, at).law)


def _at(base: Base, at: tuple[float, float], gone: Sequence[int]) -> Base:
    """The base at another presliding distance and Stribeck speed, without some shapes."""
    columns = columns_at(base, at)
    columns.X[:, [LEVELS.start + i for i in gone]] = 0.0
    law = Law(*at, base.law.shapes)  # its samples do not matter to the fit
    return replace(base, law=law, columns=columns, friction=base.friction_rms)


def _row(base: Base, whole: Base, part: Part) -> Contender:
    """What the part brings to a base that has none of it; ``whole`` has all of them."""
    less = without(base, [part])
    values: dict[str, float] = {}
    if part.name == "sublinear_viscous":
        whole, values["exponent"] = _greased(less)
    torque = whole.columns.X @ whole.made.b - less.columns.X @ less.made.b
    values |= _values(whole, part)
    return Contender(
        entry=Entry(part.name, values),
        base=less,
        columns=whole.columns,
        made=whole.made,
        own=0,
        blocks=whole.score,
        torque=torque,
        J=whole.J,
        whole=rms(_own(whole, part, torque)) / less.friction_rms,
    )


def _own(whole: Base, part: Part, torque: np.ndarray) -> np.ndarray:
    """All of the part's torque; of presliding what no rigid friction imitates."""
    if part.name == "presliding":
        return torque
    at = [LEVELS.start + NAMES.index(k) for k in part.shapes]
    return whole.columns.X[:, at] @ whole.made.b[at]


def _greased(less: Base) -> tuple[Base, float]:
    """The likeliest exponent of a viscous torque that grows slower than speed."""
    w, at = less.record.motion.w, LEVELS.start + NAMES.index("grease")
    tried = []
    for n in EXPONENTS:
        X = less.columns.X.copy()
        X[:, at] = less.record.mean(np.sign(w) * np.abs(w) ** n)
        tried.append((replace(less, columns=replace(less.columns, X=X)), n))
    return max(tried, key=lambda one: likelihood(one[0].made.r))


def _values(whole: Base, part: Part) -> dict[str, float]:
    """Start values of the part, as its block has them."""
    b = dict(zip(NAMES, whole.made.b[LEVELS].tolist(), strict=True))
    if part.name == "stribeck":
        return {"Fs": b["Fc"] + sum(b[k] for k in FORCES[1:]), "vs": whole.law.vs}
    if part.name == "presliding":
        level = b["Fc"] + sum(b[k] for k in FORCES[1:])
        return bristle(level, whole.made.b[LEVELS], whole.law.x0)
    return {"coefficient": b["grease"]}
