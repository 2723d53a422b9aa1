"""What is fitted: the terms for the motion that the record shows, and the widths to try."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.model import Model
from .constants import (
    FEWEST_SAMPLES,
    LONGEST_SHARE,
    TURNED,
    TURNED_IN_MAP,
    WIDTHS,
)
from .terms import COULOMB, DRIFT, GRAVITY, INERTIA, OFFSET, VISCOUS, Bend, Sine, Slope, Term
from .track import Track


@dataclass(frozen=True)
class Travel:
    """The widest travel of the position in rad, and its middle; 0 without a position."""

    span: float
    middle: float


def travel_of(tracks: Sequence[Track], across: bool) -> Travel:
    """The travel within a stretch, or across all of them (a map)."""
    if tracks[0].theta is None:
        return Travel(0.0, 0.0)
    theta = [p.theta[p.ok] for p in tracks if p.theta is not None]
    ends = np.array([(x.min(), x.max()) for x in theta])
    span = np.ptp(ends) if across else np.ptp(ends, axis=1).max()
    return Travel(float(span), float(np.mean([x.mean() for x in theta])))


def plain_terms(model: Model, travel: Travel, is_map: bool) -> list[Term]:
    """J, Fc, Fv, a constant, the drift of friction, and gravity where the position shows it."""
    terms = [COULOMB, VISCOUS, OFFSET] if is_map else [INERTIA, COULOMB, VISCOUS, OFFSET, DRIFT]
    if turns_enough(model, travel, is_map):
        return [*terms, *GRAVITY]
    spring = any(part.block.name == "return_spring" for part in model.effects)
    if travel.span > 0 and not spring and model.motion == "linear":
        terms.append(Term("slope", Slope(travel.middle)))
    elif travel.span > 0 and not spring:
        terms += [Term("slope", Sine(travel.middle)), Term("bend", Bend(travel.middle))]
    return terms


def turns_enough(model: Model, travel: Travel, is_map: bool) -> bool:
    """Whether gravity over the position is a term."""
    if not travel.span:
        return False
    if any(part.block.name == "gravity" for part in model.effects):
        return True
    return model.motion != "linear" and travel.span > (TURNED_IN_MAP if is_map else TURNED)


def widths_of(tracks: Sequence[Track]) -> list[float]:
    """Half-widths in s that the sample time and the longest stretch allow."""
    dt = float(np.median([p.dt for p in tracks]))
    longest = max(p.duration for p in tracks)
    widths = [L for L in WIDTHS if L >= FEWEST_SAMPLES * dt and L < LONGEST_SHARE * longest]
    return widths or [min(max(FEWEST_SAMPLES * dt, WIDTHS[0]), longest / 3)]
