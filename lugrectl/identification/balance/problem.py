"""What the record is: its sensors, whether it is a map, its terms and widths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.model import Model
from ...record.stretches import Stretch
from .constants import (
    DECLARED_DELAY,
    DELAY_SAMPLES,
    DELAY_SECONDS,
    FEWEST_SAMPLES,
    LITTLE,
    LONGEST_SHARE,
    SLOW,
    SURE,
    WIDTHS,
)
from .declared import DELAY, Use, held_terms, uses_of
from .fit import Setting
from .friction_shapes import with_rest
from .motion import Sensors, with_speed
from .speed_channel import Comparison, sensors_of
from .steady import as_points, evenly, steady
from .terms import Term, Travel, plain_terms, reversals, travel_of, turns_enough
from .track import Track, tracks_of
from .windows import Source

MAJORITY = 0.5  # of the top speed of a stretch: above it, no smoothing reaches a start or a stop
DEAD = "u is {:.4g} in every row: the torque channel is dead."
ONE = (
    "u is {:.4g} in every row: the torque channel is dead, or one torque acts throughout. Then any "
    "inertia fits, with some friction."
)
ONE_EACH_WAY = (
    "At speed, u has one value in each direction ({}): any inertia fits, with some friction. "
    "Record two or more torques in each direction."
)


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
    blind: str

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
        return Unanswerable(("No stretch of the record has more than 12 good samples.",))
    if tracks[0].theta is None and tracks[0].w is None:
        return Unanswerable(("the runs have no motion signal in common: theta or w.",))
    sensors, comparison, notes = sensors_of(tracks)
    if tracks[0].theta is None and not sensors.use_w:
        return Unanswerable(tuple(notes))
    still = steady(tracks, sensors)
    dead = _dead(tracks, still is not None, held)
    if dead is not None:
        return Unanswerable((*notes, (DEAD if dead == 0 else ONE).format(dead)), dead)
    tracks, speed, noise = with_speed(still or tracks, sensors)
    if not speed > 0:
        return Unanswerable((*notes, "nothing moves."))
    ways = None if held.get("J") else _one_torque_each_way(tracks)
    blind = "" if ways is None else ONE_EACH_WAY.format(" and ".join(f"{u:.4g}" for u in ways))
    if blind and still is None:
        return Unanswerable((*notes, blind))
    if still is None:
        tracks, widths, setting = _moving(tracks, speed, noise, model, held)
    else:
        notes = [*notes, "The runs keep one speed each: they are a map, which does not show J."]
        tracks = with_rest(as_points(tracks), 0.0)
        turns = turns_enough(model, travel_of(tracks, across=True), is_map=True)
        tracks, width = evenly(tracks, travel_of(tracks, across=True).span, speed, turns)
        widths, setting = (width / 2, width), Setting(0.0, 0.0)
    travel = travel_of(tracks, across=still is not None)
    uses, unused = uses_of(model, tracks, held, travel.middle)
    terms = plain_terms(model, travel, still is not None, reversals(tracks))
    terms += [term for use in uses for term in use.terms]
    known = held_terms(held, uses, terms)
    return Ground(
        model=model,
        source=Source([replace(p, load=np.zeros(len(p))) for p in tracks], sensors, known),
        terms=tuple(t for t in terms if all(t is not k for k, _ in known)),
        uses=tuple(uses),
        held=held,
        widths=widths,
        setting=replace(setting, held=tuple((term.key, value) for term, value in known)),
        speed=speed,
        travel=travel,
        is_map=still is not None,
        comparison=comparison,
        notes=(*notes, *unused),
        blind=blind,
    )


def _dead(tracks: Sequence[Track], is_map: bool, held: Mapping[str, float]) -> float | None:
    """The torque, if it has one value throughout and nothing else is known of the torque."""
    first = float(tracks[0].u[tracks[0].ok][0])
    same = all(np.all(p.u[p.ok] == first) for p in tracks)
    if not same or held.get("J") or (is_map and first != 0):
        return None
    return first


def _one_torque_each_way(tracks: Sequence[Track]) -> list[float] | None:
    """The torque of each direction, if it is one value at speed while the speed still rises.

    Then ``J a = u - F(w)`` makes a a function of w in each direction: with any J there is a
    friction F that fits exactly, and noise of the motion decides between them.
    """
    found: dict[float, set[float]] = {1.0: set(), -1.0: set()}
    rises = False
    for p in tracks:
        speed = np.abs(p.speed) / np.abs(p.speed[p.ok]).max()
        fast = p.ok & (speed > MAJORITY)
        rises |= np.count_nonzero(fast & (speed < 1 - LITTLE)) > 2 * FEWEST_SAMPLES
        for way, values in found.items():
            values.update(np.unique(p.u[fast & (np.sign(p.speed) == way)]).tolist())
    several = any(len(values) > 1 for values in found.values())
    return None if several or not rises else [u for values in found.values() for u in values]


def _moving(
    tracks: Sequence[Track], speed: float, noise: float, model: Model, held: Mapping[str, float]
) -> tuple[list[Track], tuple[float, ...], Setting]:
    """Runs whose speed changes: J and a delay of u are fitted, at half-widths that the sample time
    and the longest stretch allow."""
    rest = max(SURE * noise, SLOW * speed)
    dt = float(np.median([p.dt for p in tracks]))
    prior, delay = min(DELAY_SAMPLES * dt, max(DELAY_SECONDS, dt)), 0.0
    for part in model.effects:
        if part.block.name == DELAY:
            known = held.get(f"{part.key}.delay")
            prior, delay = (DECLARED_DELAY, 0.0) if known is None else (0.0, known)
    longest = max(p.duration for p in tracks)
    widths = [L for L in WIDTHS if L >= FEWEST_SAMPLES * dt and L < LONGEST_SHARE * longest]
    widths = widths or [min(max(FEWEST_SAMPLES * dt, WIDTHS[0]), longest / 3)]
    return with_rest(tracks, rest), tuple(widths), Setting(rest, prior, delay=delay)
