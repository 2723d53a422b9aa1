"""The terms of the balance: one column each, and which of them are fitted.

u(t - T) = J a + Fc sign(w) + Fv w + constant + gravity(theta) + declared effects + residual
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.model import Model
from .constants import ECCENTRIC, FEWEST_SAMPLES, LONGEST_SHARE, TURNED, TURNED_IN_MAP, WIDTHS
from .track import Track

Column = Callable[[Track], np.ndarray]


@dataclass(frozen=True, eq=False)
class Term:
    """A term that is linear in one coefficient.

    Attributes
    ----------
    key : str
        Name of the coefficient.
    column : callable or None
        The torque at every sample for a coefficient of 1; None for J and Fv, whose columns are
        the window means of acceleration and speed.
    share : float or None
        Only for what friction may do near rest: standard deviation of its prior, as a share of
        Fc. Such a term carries an uncertainty and is no answer.
    friction : bool
        Whether its torque belongs to the friction curve.
    bent : bool
        Its column is the second derivative of the torque, and ``share`` one of J.
    """

    key: str
    column: Column | None
    share: float | None = None
    friction: bool = False
    bent: bool = False


def sliding(track: Track) -> np.ndarray:
    """Column of Fc: sign(w)."""
    return np.sign(track.speed)


def pace(track: Track) -> np.ndarray:
    """Column of Fv in a map: the speed of the run. What a run's speed changes by is inertia's."""
    return track.speed


def constant(track: Track) -> np.ndarray:
    """Column of a constant torque: 1."""
    return np.ones(len(track))


def warming(track: Track) -> np.ndarray:
    """Column of the drift: sign(w) (t/T - 1/2). Every machine warms up."""
    return np.sign(track.speed) * track.age


@dataclass(frozen=True)
class Wave:
    """sin(theta) or cos(theta): gravity over the position."""

    function: Callable[[np.ndarray], np.ndarray]

    def __call__(self, track: Track) -> np.ndarray:
        assert track.theta is not None
        return self.function(track.theta)


@dataclass(frozen=True)
class Slope:
    """theta - middle: a torque that rises along a linear axis."""

    middle: float

    def __call__(self, track: Track) -> np.ndarray:
        assert track.theta is not None
        return track.theta - self.middle


@dataclass(frozen=True)
class Sine:
    """sin(theta - middle): the slope of gravity over a small angle."""

    middle: float

    def __call__(self, track: Track) -> np.ndarray:
        assert track.theta is not None
        return np.sin(track.theta - self.middle)


@dataclass(frozen=True)
class Bend:
    """cos(theta - middle) - 1: what distinguishes gravity from a constant over a small angle."""

    middle: float

    def __call__(self, track: Track) -> np.ndarray:
        assert track.theta is not None
        return np.cos(track.theta - self.middle) - 1


INERTIA = Term("J", None)
COULOMB = Term("Fc", sliding, friction=True)
VISCOUS = Term("Fv", None, friction=True)
PACE = Term("Fv", pace, friction=True)
OFFSET = Term("constant_torque", constant, friction=True)
DRIFT = Term("drift", warming)
# An encoder off its centre by e shows theta + e sin(theta + phase): J times the second derivative
ECCENTRICITY = tuple(
    Term(f"eccentric {f.__name__}", Wave(f), share=ECCENTRIC, bent=True) for f in (np.sin, np.cos)
)
GRAVITY = (Term("gravity.sin", Wave(np.sin)), Term("gravity.cos", Wave(np.cos)))


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
    terms = [COULOMB, PACE, OFFSET] if is_map else [INERTIA, COULOMB, VISCOUS, OFFSET, DRIFT]
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
