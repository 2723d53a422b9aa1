"""What the record is: its sensors, whether it is a map, its terms and widths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...model import Model
from ...record.stretch import Stretch
from .constants import (
    DECLARED_DELAY,
    DELAY_SAMPLES,
    DELAY_SECONDS,
    REST_IN_NOISE,
    REST_IN_SPEED,
)
from .declared import DELAY, Use, held_terms, uses_of
from .fit import Setting
from .motion import Sensors, with_speed
from .near_rest import with_rest
from .reconcile import Comparison, sensors_of
from .setup import Travel, plain_terms, travel_of, turns_enough, widths_of
from .steady import as_points, evenly, steady, width_of_map
from .terms import Term
from .track import Track, tracks_of
from .windows import Source


@dataclass(frozen=True)
class Unanswerable:
    """A record without an answer, and why; ``torque`` is that of a dead channel."""

    notes: tuple[str, ...]
    torque: float | None = None


@dataclass(frozen=True, eq=False)
class Ground:
    """All that a fit needs, and what was noticed on the way."""

    model: Model
    source: Source
    terms: tuple[Term, ...]
    uses: tuple[Use, ...]
    held: Mapping[str, float]
    widths: tuple[float, ...]
    setting: Setting
    speed: float
    travel: Travel
    is_map: bool
    comparison: Comparison | None
    notes: tuple[str, ...]

    @property
    def tracks(self) -> Sequence[Track]:
        return self.source.tracks

    @property
    def sensors(self) -> Sensors:
        return self.source.sensors


def ground_of(
    stretches: Sequence[Stretch], model: Model, held: Mapping[str, float]
) -> Ground | Unanswerable:
    """The record prepared for a fit."""
    tracks = tracks_of(stretches)
    if not tracks:
        return Unanswerable(("no stretch of the record has 12 good samples.",))
    if tracks[0].theta is None and tracks[0].w is None:
        return Unanswerable(("the runs have no motion signal in common: theta or w.",))
    sensors, comparison, notes = sensors_of(tracks)
    if tracks[0].theta is None and not sensors.use_w:
        return Unanswerable(tuple(notes))
    still = steady(tracks, sensors)
    dead = _dead(tracks, still is not None, held)
    if dead is not None:
        sentence = f"u is {dead:.4g} in every row: the torque channel is dead."
        return Unanswerable((*notes, sentence), dead)
    tracks, speed, noise = with_speed(still or tracks, sensors)
    if not speed > 0:
        return Unanswerable((*notes, "nothing moves."))
    if still is None:
        return _moving(tracks, model, held, sensors, comparison, notes, speed, noise)
    notes = [*notes, "the runs are at steady speed and are read as a map, which does not show J."]
    return _map(tracks, model, held, sensors, comparison, notes, speed)


def _dead(tracks: Sequence[Track], is_map: bool, held: Mapping[str, float]) -> float | None:
    """The torque, if it has one value throughout and nothing else is known of the torque."""
    first = float(tracks[0].u[tracks[0].ok][0])
    same = all(np.all(p.u[p.ok] == first) for p in tracks)
    if not same or held.get("J") or (is_map and first != 0):
        return None
    return first


def _moving(
    tracks: list[Track],
    model: Model,
    held: Mapping[str, float],
    sensors: Sensors,
    comparison: Comparison | None,
    notes: list[str],
    speed: float,
    noise: float,
) -> Ground:
    rest = max(REST_IN_NOISE * noise, REST_IN_SPEED * speed)
    tracks = with_rest(tracks, rest)
    travel = travel_of(tracks, across=False)
    dt = float(np.median([p.dt for p in tracks]))
    prior = min(DELAY_SAMPLES * dt, max(DELAY_SECONDS, dt))
    if any(part.block.name == DELAY for part in model.effects):
        prior = DECLARED_DELAY
    return _with_terms(
        tracks, model, held, sensors, comparison, notes, speed, travel, widths_of(tracks),
        (rest, prior), False,
    )  # fmt: skip


def _map(
    tracks: list[Track],
    model: Model,
    held: Mapping[str, float],
    sensors: Sensors,
    comparison: Comparison | None,
    notes: list[str],
    speed: float,
) -> Ground:
    tracks = with_rest(as_points(tracks), 0.0)
    travel = travel_of(tracks, across=True)
    gravity = turns_enough(model, travel, True)
    width = width_of_map(tracks, travel, speed, gravity)
    return _with_terms(
        evenly(tracks, width), model, held, sensors, comparison, notes, speed, travel,
        [width / 2, width], (0.0, 0.0), True,
    )  # fmt: skip


def _with_terms(
    tracks: list[Track],
    model: Model,
    held: Mapping[str, float],
    sensors: Sensors,
    comparison: Comparison | None,
    notes: list[str],
    speed: float,
    travel: Travel,
    widths: list[float],
    limits: tuple[float, float],
    is_map: bool,
) -> Ground:
    uses, unused = uses_of(model, tracks, held, travel.middle)
    terms = plain_terms(model, travel, is_map)
    terms += [term for use in uses for term in use.terms]
    known = held_terms(held, uses, terms)
    setting = Setting(*limits, held=tuple((term.key, value) for term, value in known))
    loads = [replace(p, load=np.zeros(len(p))) for p in tracks]
    return Ground(
        model=model,
        source=Source(loads, sensors, known),
        terms=tuple(t for t in terms if all(t is not k for k, _ in known)),
        uses=tuple(uses),
        held=held,
        widths=tuple(widths),
        setting=setting,
        speed=speed,
        travel=travel,
        is_map=is_map,
        comparison=comparison,
        notes=(*notes, *unused),
    )
