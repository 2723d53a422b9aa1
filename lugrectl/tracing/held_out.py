"""What a run that is held out as a whole has for itself: offset, friction, where theta is zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model import Model
from .fit import Fitted, fit
from .predictor import Windows
from .runs import alike, knows_places, repeats
from .score import whitened_by_parts

SETTLED = 5  # part of a lead-in after which it counts
PER_PERIOD, FINEST = 12, 600  # phases tried in each period, and at most
WORST = 1e6  # innovation that counts for a set that makes the plant unstable


def adapted(fitted: Fitted, test: Windows, declared: Model) -> Fitted:
    """The same with what held-out runs have for themselves, by their lead-ins alone.

    No sample that is judged is used. Offset and friction only where the runs that were fitted
    differ in these, too; where theta is zero if nothing that was declared hangs on it.
    """
    data, model = fitted.predictor.data, fitted.predictor.model
    runs = sorted(set(data.run[test.counted].ravel().tolist()) - {0, *data.differing})
    free = fitted.predictor.repeating and not knows_places(declared)
    if not runs or not (data.differing or free):
        return fitted
    lead = Windows(test.start, test.burn // SETTLED, test.burn - test.burn // SETTLED)
    warmed = bool(data.differing)
    if free and not data.zeros:
        order = 1.0 if model.motion == "rotary" else max(_orders(fitted))
        data = data.aligned(dict.fromkeys((*data.differing, *runs), 0.0), order)
    data = replace(data, differing=(*data.differing, *runs))
    found = replace(fitted, predictor=fitted.predictor.on(data), where=lead)
    found = replace(found, values=alike(data) | fitted.values)
    kinds = found.predictor.declarations()
    own = [k for k in alike(replace(data, differing=tuple(runs))) if k in kinds]
    own = [k for k in own if warmed or kinds[k].angle]
    for key in own:
        if kinds[key].angle:
            found = replace(found, values=_placed(found, key))
    predictor, values = found.predictor, found.values
    near = fit(predictor, values, own, lead, fitted.noise, most=10, rough=True)
    return replace(fitted, predictor=predictor, values=near.values)


def _placed(found: Fitted, key: str) -> dict[str, float]:
    """The likeliest phase of a run, over all that differ in what they do."""
    orders, unit = _orders(found), found.predictor.data.order
    widest = np.pi * unit / (orders[0] if len(set(orders)) == 1 else 1.0)
    count = min(FINEST, int(PER_PERIOD * max(orders) * widest / (np.pi * unit)) + 1)
    sets = [{**found.values, key: float(p)} for p in np.linspace(-widest, widest, count)]
    white = np.nan_to_num(whitened_by_parts(found.predictor, sets, found), posinf=WORST)
    return sets[int(np.argmin(np.sum(np.abs(white), axis=(1, 2, 3))))]


def _orders(fitted: Fitted) -> list[float]:
    """How often effects repeat themselves per 2 pi of theta."""
    parts = [p for p in fitted.predictor.model.effects if repeats(p.block)]
    return [fitted.values.get(f"{p.key}.harmonic", 1.0) for p in parts]
