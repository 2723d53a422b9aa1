"""An effect beside the friction law that is the likeliest with it in the model.

The base has the presliding distance and the Stribeck speed that suit the likeliest effect. Where
another explains nearly as much, these numbers would decide between the two; so each has its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...blocks.block import REGISTRY
from ..regression.numbers import NEAR
from ..regression.robust_regression import likelihood, solve
from .base_model import LEVELS
from .candidate import Contender, enter
from .effect_columns import by_run, columns
from .friction_level import on_level
from .friction_shape import columns_at, likeliest, relaid

MOST_NEAR = 4
TIMES = 3  # the level of friction beside it moves with the law


def each_in_its_own_law(good: Sequence[Contender]) -> list[Contender]:
    """The contenders, those near the best beside their own laws, the best first."""
    near = [c for c in good if c.gain > NEAR * good[0].gain][:MOST_NEAR]
    if len(near) < 2:
        return list(good)
    return sorted([*map(in_its_own_law, near), *good[len(near) :]], key=lambda c: -c.gain)


def in_its_own_law(c: Contender) -> Contender:
    """The contender beside its own likeliest law, where that explains more."""
    for _ in range(TIMES):
        again = _once(c)
        if not again.gain > c.gain:
            break
        c = again
    return c


def _once(c: Contender) -> Contender:
    base, own, near = c.base, c.its, c.made
    y = base.y if c.u is None else base.record.driving(c.u)

    def likely(x0: float, vs: float) -> float:
        nonlocal near
        beside = columns_at(base, (x0, vs)) + own
        near = solve(beside.X, y, beside.prior, beside.low, beside.high, base.view.scale,
                     near.weight, rounds=3, near=near.state)  # fmt: skip
        return likelihood(near.r)

    at = likeliest(likely, [c.entry.law or (base.law.x0, base.law.vs)])
    entry = replace(c.entry, law=at)
    if on_level(REGISTRY["effect", c.name]) and c.own:
        levels = replace(relaid(base, at), levels=c.made.b[LEVELS])
        made = columns(levels, REGISTRY["effect", c.name], c.values)
        entry = replace(entry, columns=by_run(base, made) if entry.by_run else made)
    return enter(base, entry)
