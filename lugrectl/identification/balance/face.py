"""The door: balance(stretches, model)."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from ...model import Model
from ...record.stretch import Stretch
from ...results import Estimate
from .constants import CONFIDENCE, DELAY_SAMPLES, DELAY_SECONDS, REST_IN_NOISE, REST_IN_SPEED
from .fit import Setting
from .motion import with_speed
from .near_rest import shapes_near_rest, with_rest
from .reconcile import sensors_of
from .result import Balance
from .search import best_width
from .setup import plain_terms, travel_of, widths_of
from .track import tracks_of
from .windows import Source
from .fit import fit


def balance(
    stretches: Sequence[Stretch], model: Model, held: Mapping[str, float] | Sequence[str] = ()
) -> Balance:
    began = time.perf_counter()
    tracks = tracks_of(stretches)
    sensors, comparison, notes = sensors_of(tracks)
    tracks, speed, noise = with_speed(tracks, sensors)
    rest = max(REST_IN_NOISE * noise, REST_IN_SPEED * speed)
    tracks = with_rest(tracks, rest)
    dt = float(np.median([p.dt for p in tracks]))
    setting = Setting(rest, min(DELAY_SAMPLES * dt, max(DELAY_SECONDS, dt)))
    source = Source(tracks, sensors)
    terms = plain_terms(model, travel_of(tracks, False), False)
    made = best_width(source, widths_of(tracks), terms, setting)
    made = fit(
        source,
        made.half_width,
        [*made.terms, *shapes_near_rest(speed, made.half_width)],
        setting,
        made.delay,
    )
    tq = stats.t.ppf(
        0.5 + CONFIDENCE / 2, max(made.blocks - sum(t.share is None for t in made.terms), 2)
    )
    par = {}
    for k, term in enumerate(made.terms):
        if term.share is None:
            h = tq * made.V[k, k] ** 0.5
            par[term.key] = Estimate(made.p[k], "", (made.p[k] - h, made.p[k] + h))
    h = tq * made.V[len(made.terms), len(made.terms)] ** 0.5
    par["u_delay"] = Estimate(made.delay, "s", (made.delay - h, made.delay + h))
    return Balance(
        par, seconds=time.perf_counter() - began, notes=tuple(notes), half_width=made.half_width
    )
