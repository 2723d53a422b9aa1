"""Parts of friction that the declared law does not have: a Stribeck curve, bristles.

All shapes of friction are in the base while effects are judged. Here one part at a time is taken
out again; where left-out blocks are then predicted worse, the part is needed, and where the
declared law has no such part, it is an effect: ``stribeck``, ``presliding``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..blocks.model import Model
from ..core.regression import paired, robust
from .table import Table

RIGID = 1e-3  # of the shortest bristle that is tried: none to see
SHAPES = {"stribeck": ("bump", "short_tail", "long_tail"), "presliding": ()}


@dataclass(frozen=True)
class Part:
    """A part of friction: how much it gains in nats, the standard error, its share of friction."""

    name: str
    gain: float
    error: float
    share: float


def missing(model: Model) -> list[str]:
    """The parts that neither the declared law nor a declared effect has."""
    law, here = model.friction, {p.block.name for p in model.effects}
    has = {"stribeck": "Fs" in law.values or not {"Fc"} <= law.values.keys(),
           "presliding": bool(law.block.states) or "Fc" not in law.values}  # fmt: skip
    return [name for name, there in has.items() if not there and name not in here]


def parts(table: Table) -> list[Part]:
    """The parts that are missing, each by the base with and without it."""
    return [_part(table, name) for name in missing(table.view.model)]


def _part(table: Table, name: str) -> Part:
    v = table.view
    X = table.X.copy()
    if name == "presliding":
        rigid = RIGID * float(v.grids()[0][0])
        own = v.base(rigid, v.vs)
        X[:, : own.shape[1]] = own
    for shape in SHAPES[name]:
        X[:, v.names.index(shape)] = 0.0
    fit = robust(X, table.y, table.prior, table.scale, v.noise, table.root**2)
    e = v.blocks.left_out(fit, X, table.prior, table.scale, 1.0)
    full = v.blocks.left_out(table.fit, table.X, table.prior, table.scale, 1.0)
    gain, error = paired(full, e)
    torque = table.X @ table.fit.b - X @ fit.b
    return Part(name, gain, error, float(np.sqrt(np.mean(torque**2))) / v.size)
