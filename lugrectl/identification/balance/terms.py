"""The terms of the balance: one column each, and which of them are fitted.

u(t - T) = J a + Fc sign(w) + Fv w + constant + gravity(theta) + declared effects + residual
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.measured_bristle import along
from ...blocks.model import Model
from .constants import (
    DIPS,
    ECCENTRIC,
    FEWEST_CHANGES,
    GONE,
    REST_TORQUE,
    TURNED,
    TURNED_IN_MAP,
    TURNS,
)
from .track import Track

Column = Callable[[Track], np.ndarray]


@dataclass(frozen=True)
class Term:
    """A term that is linear in one coefficient.

    ``column`` is its torque at every sample for a coefficient of 1; None for J and Fv, whose
    columns are the window means of acceleration and speed. ``share`` is that of Fc which a term
    may take that is no answer but carries what the shape of friction leaves open. ``friction``:
    its torque belongs to the friction curve. ``bent``: its column is the second derivative of the
    torque, and ``share`` one of J.
    """

    key: str
    column: Column | None
    share: float | None = None
    friction: bool = False
    bent: bool = False


def sliding(track: Track) -> np.ndarray:
    """sign(w)."""
    return np.sign(track.speed)


def pace(track: Track) -> np.ndarray:
    """The speed, of a run of a map: what a run's speed changes by is inertia's."""
    return track.speed


def constant(track: Track) -> np.ndarray:
    """1."""
    return np.ones(len(track))


def warming(track: Track) -> np.ndarray:
    """sign(w) (t/T - 1/2): every machine warms up."""
    return np.sign(track.speed) * track.age


def stopping(track: Track) -> np.ndarray:
    """At rest, the direction of the motion before."""
    return track.stopping


def starting(track: Track) -> np.ndarray:
    """At rest, the direction of the motion after."""
    return track.starting


def at_position(function: Callable[[np.ndarray], np.ndarray], about: float = 0.0) -> Column:
    """A function of the position from ``about`` on."""

    def column(track: Track) -> np.ndarray:
        assert track.theta is not None
        return function(track.theta - about)

    return column


def bend(x: np.ndarray) -> np.ndarray:
    """What distinguishes gravity from a constant over a small angle."""
    return np.cos(x) - 1


def dip(speed: float, power: int) -> Column:
    """sign(w) exp(-(|w|/speed)^power): friction that falls with speed (Stribeck)."""

    def column(track: Track) -> np.ndarray:
        x = np.abs(track.speed / speed).astype(np.float32)  # six digits, in half the time
        return np.sign(track.speed) * np.exp(-np.minimum(x if power == 1 else x * x, GONE))

    return column


def drag(speed: float) -> Column:
    """w |w| / speed^2: friction that grows faster than the speed."""
    return lambda track: track.speed * np.abs(track.speed) / speed**2


def tilt(speed: float) -> Column:
    """|w| / speed: friction that is steeper one way."""
    return lambda track: np.abs(track.speed) / speed


def turning(near: float, far: float) -> Column:
    """Coulomb friction that turns over within ``far`` after a reversal, minus that in ``near``."""

    def column(track: Track) -> np.ndarray:
        sooner = along(*track.strokes, near) if near else np.sign(track.speed)
        return along(*track.strokes, far) - sooner

    return column


INERTIA = Term("J", None)
COULOMB = Term("Fc", sliding, friction=True)
VISCOUS = Term("Fv", None, friction=True)
PACE = Term("Fv", pace, friction=True)
OFFSET = Term("constant_torque", constant, friction=True)
DRIFT = Term("drift", warming)
GRAVITY = (Term("gravity.sin", at_position(np.sin)), Term("gravity.cos", at_position(np.cos)))
# An encoder off its centre by e shows theta + e sin(theta + phase): J times the second derivative
ECCENTRICITY = tuple(
    Term(f"eccentric {g.key}", g.column, share=ECCENTRIC, bent=True) for g in GRAVITY
)


def near_rest(speed: float, half_width: float) -> list[Term]:
    """The terms that carry what the shape of friction near rest leaves open."""
    length = speed * half_width
    turns = [(turning(a * length, b * length), share) for (a, b), share in TURNS]
    dips = [(dip(v * speed, 1), share) for v, share in DIPS]
    rests = [(stopping, REST_TORQUE), (starting, REST_TORQUE)]
    every = enumerate([*turns, *dips, *rests])
    return [Term(f"near rest {i}", c, share, True) for i, (c, share) in every]


def bristle(distance: float) -> Column:
    """Coulomb friction that turns over within a distance after a reversal (Dahl)."""
    return lambda track: along(*track.strokes, distance)


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


def reversals(tracks: Sequence[Track]) -> int:
    """How often the motion turns."""
    return sum(max(len(track.strokes[1]) - 1, 0) for track in tracks)


def plain_terms(model: Model, travel: Travel, is_map: bool, turns: int) -> list[Term]:
    """J, Fc, Fv, a constant, the drift of friction, and gravity where the position shows it.

    Without several reversals a drift of friction is a torque that follows the time: it fits any
    ramp of u, and any runs in one direction.
    """
    terms = [COULOMB, PACE, OFFSET] if is_map else [INERTIA, COULOMB, VISCOUS, OFFSET]
    terms += [DRIFT] if turns >= FEWEST_CHANGES and not is_map else []
    if turns_enough(model, travel, is_map):
        return [*terms, *GRAVITY]
    if not travel.span or any(part.block.name == "return_spring" for part in model.effects):
        return terms
    if model.motion == "linear":
        return [*terms, Term("slope", at_position(np.positive, travel.middle))]
    over = {"slope": np.sin, "bend": bend}
    return [*terms, *(Term(k, at_position(f, travel.middle)) for k, f in over.items())]


def turns_enough(model: Model, travel: Travel, is_map: bool) -> bool:
    """Whether gravity over the position is a term."""
    if not travel.span:
        return False
    if any(part.block.name == "gravity" for part in model.effects):
        return True
    return model.motion != "linear" and travel.span > (TURNED_IN_MAP if is_map else TURNED)
