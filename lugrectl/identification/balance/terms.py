"""The terms of the balance: one column each.

u(t - T) = J a + Fc sign(w) + Fv w + constant + gravity(theta) + declared effects + residual
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .constants import ECCENTRIC
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
OFFSET = Term("constant_torque", constant, friction=True)
DRIFT = Term("drift", warming)
# An encoder off its centre by e shows theta + e sin(theta + phase): J times the second derivative
ECCENTRICITY = tuple(
    Term(f"eccentric {f.__name__}", Wave(f), share=ECCENTRIC, bent=True) for f in (np.sin, np.cos)
)
GRAVITY = (Term("gravity.sin", Wave(np.sin)), Term("gravity.cos", Wave(np.cos)))
