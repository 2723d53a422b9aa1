"""What a model states of its values, held, bounded or known with an error, in a regression."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..blocks.declared_values import Stated
from ..blocks.model import Model
from ..core.regression import Prior
from .columns import linear

if TYPE_CHECKING:
    from .friction import Term

SURE = 1e-6  # of a held value: its standard deviation
Range = tuple[float, float] | None


class _Known(NamedTuple):
    """A coefficient at ``place``, what is stated of it, and its declared value."""

    place: int
    stated: Stated
    value: float | None


def inertia_range(found: Range, model: Model) -> Range:
    """Where J lies: where it was found, and as it is stated."""
    one, J = model.stated.get("J", Stated()), model.J
    if one.fixed and J is not None:
        return J, J
    if not one.bounded:
        return found
    low, high = (0.0, np.inf) if found is None else found
    return max(low, one.low or 0.0), min(high, np.inf if one.high is None else one.high)


def with_stated(prior: Prior, names: Sequence[Any], terms: Sequence[Term], model: Model) -> Prior:
    """The prior of a last fit with what the model states of its coefficients."""
    for known in _stated(names, terms, model):
        prior = _with(prior, known)
    return prior


def _with(prior: Prior, known: _Known) -> Prior:
    j, one, value = known
    if one.fixed and value is not None:
        sd = SURE * max(abs(value), 1e-12)
        low, high = sorted((value * (1 - SURE), value * (1 + SURE)))
        return prior.but(j, precision=1 / sd**2, centre=value, low=low - sd, high=high + sd)
    if one.std is not None and value is not None:
        prior = prior.but(j, precision=1 / one.std**2, centre=value)
    low = prior.low[j] if one.low is None else max(prior.low[j], one.low)
    high = prior.high[j] if one.high is None else min(prior.high[j], one.high)
    return prior.but(j, low=low, high=max(high, low))


def _stated(names: Sequence[Any], terms: Sequence[Term], model: Model) -> Iterator[_Known]:
    stated, values = model.stated, model.values()
    for key in ("J", "Fc", "Fv"):
        if key in stated and key in names:
            yield _Known(names.index(key), stated[key], values[key])
    if {"Fc", "Fs"} <= model.held():
        dip = (values["Fs"] or 0.0) - (values["Fc"] or 0.0)
        yield _Known(names.index("dip"), stated["Fs"], dip)
    for i, term in enumerate(terms):
        gain = f"{term.key}.{term.block.gain}"
        if gain not in stated or (i, 0) not in names:
            continue
        neutral = term.block.own[term.block.gain].neutral or 0.0
        if len(linear(term.block)) == 1:
            value = values[gain]
            yield _Known(names.index((i, 0)), _moved(stated[gain], -neutral),
                         None if value is None else value - neutral)  # fmt: skip
        elif stated[gain].fixed:  # the phase stays where it was found
            yield from _of_waves(names, i, term, values, gain, stated[gain])


def _of_waves(
    names: Sequence[Any], i: int, term: Term, values: Any, gain: str, one: Stated
) -> Iterator[_Known]:
    phase = term.key + "." + linear(term.block)[1]
    if values.get(phase) is not None and term.block.own[linear(term.block)[1]].angle:
        way = np.array([np.cos(values[phase]), np.sin(values[phase])])
    else:
        way = term.b / (float(np.hypot(*term.b)) or 1.0)
    for k in (0, 1):
        yield _Known(names.index((i, k)), one, float(values[gain] * way[k]))


def _moved(one: Stated, by: float) -> Stated:
    low, high = (None if x is None else x + by for x in (one.low, one.high))
    return Stated(one.fixed, low, high, one.std)
