"""Nuisance parameters of a run held out as a whole: torque offset, friction factor, encoder
zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...blocks.model import Model
from ..dataset.dataset import Data
from ..dataset.run_effects import MOST_RUNS, alike, knows_places, orders, repeating
from ..dataset.windows import Windows
from .likelihood import whitened_by_parts
from .maximise import Fitted, fit

SETTLED = 5  # the first fifth of a lead-in does not count
PER_PERIOD, FINEST = 12, 600  # phases tried per period, and at most in all


def adapted(fitted: Fitted, test: Windows, declared: Model) -> Fitted:
    """The same with the nuisance parameters of held-out runs, from their lead-ins alone.

    No sample that is judged is used. The zero of theta is fitted only if no declared effect depends
    on theta.
    """
    data, runs = fitted.predictor.data, _held_out(fitted, test)
    if not runs:
        return fitted
    free = repeating(fitted.predictor.model) and not knows_places(declared)
    found = _apart(fitted, _with_places(fitted, runs) if free else data, runs)
    kinds = found.predictor.declarations()
    own = [k for k in _own(found, runs) if k in kinds]
    lead = Windows(test.start, test.burn // SETTLED, test.burn - test.burn // SETTLED)
    for key in own:
        if kinds[key].angle:
            found = replace(found, values=_placed(found, key, lead))
    return _refitted(found, own, lead)


def _held_out(fitted: Fitted, test: Windows) -> list[int]:
    """The runs held out as a whole; never the first, which is the reference."""
    run = fitted.predictor.data.run
    seen = {0, *run[fitted.where.start].tolist()}
    runs = sorted(set(run[test.start].tolist()) - seen)
    return runs if len(runs) < MOST_RUNS else []


def _with_places(fitted: Fitted, runs: Sequence[int]) -> Data:
    """Data in which theta of the runs may be shifted; by 0 so far if they agreed."""
    data = fitted.predictor.data
    if data.zeros:
        return data
    none = dict.fromkeys((*data.differing, *runs), 0.0)
    return data.aligned(none, max(orders(fitted.predictor.model, fitted.values)))


def _apart(fitted: Fitted, data: Data, runs: Sequence[int]) -> Fitted:
    """The same on data in which ``runs`` may differ, too."""
    data = replace(data, differing=tuple(sorted({*data.differing, *runs})))
    values = alike(data) | fitted.values
    return replace(fitted, predictor=fitted.predictor.on(data), values=values)


def _own(fitted: Fitted, runs: Sequence[int]) -> list[str]:
    """The keys of these runs' nuisance parameters."""
    return list(alike(replace(fitted.predictor.data, differing=tuple(runs))))


def _refitted(found: Fitted, own: Sequence[str], where: Windows) -> Fitted:
    """The same with these values fitted to other windows."""
    near = fit(found.predictor, found.values, own, where, found.noise, most=10, rough=True)
    return replace(found, values=near.values)


def _placed(found: Fitted, key: str, where: Windows) -> dict[str, float]:
    """The most likely phase of a run in some windows, over a grid of all distinct ones."""
    often, unit = orders(found.predictor.model, found.values), found.predictor.data.order
    widest = np.pi * unit / (often[0] if len(set(often)) == 1 else 1.0)
    count = min(FINEST, int(PER_PERIOD * max(often) * widest / (np.pi * unit)) + 1)
    sets = [{**found.values, key: float(p)} for p in np.linspace(-widest, widest, count)]
    white = whitened_by_parts(found.predictor, sets, where, found.noise)
    return sets[int(np.argmin(np.sum(np.abs(white), axis=(1, 2, 3))))]
