"""Effects that change the level of friction: with direction, position, load or time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..block import P
from ..declaration import block
from .loads import PHASE

RATIO: Any = P(0.0, "1", -0.95, 20.0, neutral=0.0)


@block(
    "effect",
    out="level",
    acts="Fc Fs",
    confused="torque_ripple gravity coulomb_asymmetry load_dependent_friction",
    experiment="record the same slow path forwards and backwards: half the difference of the two "
    "torques is friction, half their sum is not",
)
def position_dependent_friction(
    theta,
    ratio=P(0.0, "1", 0.0, 0.95, neutral=0.0),
    harmonic=P(1.0, "1/rev", 1e-3, 1e9, whole=True),
    phase=PHASE,
):
    """G = 1 + a sin(N theta + phi).

    N >= 1 on rotary drives; on linear drives N = 2 pi / period in rad/m. In a log: a spectral
    line at an order of the position that changes sign with the direction (a bent shaft, a tight
    spot in a guide). In one direction only, a torque ripple or gravity looks the same.
    """
    return ratio * np.sin(harmonic * theta + phase)


@block(
    "effect",
    out="level",
    acts="Fc Fs",
    abrupt=True,
    confused="constant_torque viscous_asymmetry",
    experiment="record the same slow move in both directions, with holds at zero torque between",
)
def coulomb_asymmetry(w, ratio=P(0.0, "1", -0.95, 0.95, neutral=0.0)):
    """G = 1 + a sign(w).

    In a log: a torque that is constant while the drive moves and zero while it rests. If the
    drive hardly rests, a constant torque looks the same.
    """
    return ratio * np.sign(w)


@block(
    "effect",
    out="level",
    acts="Fv",
    confused="quadratic_drag coulomb_asymmetry",
    experiment="record constant speeds, slow to fast, in both directions",
)
def viscous_asymmetry(w, ratio=P(0.0, "1", -1.0, 1.0, neutral=0.0)):
    """Fv (1 + a sign(w)).

    In a log: a residual that grows with speed and has the same sign in both directions. At a
    single speed an asymmetry of Coulomb friction looks the same.
    """
    return ratio * np.sign(w)


@block(
    "effect",
    out="level",
    acts="Fc Fs Fv",
    confused="friction_step quadratic_drag",
    experiment="repeat the same run cold and warm, alternating two speeds, and log the temperature",
)
def thermal_drift(t, ratio=RATIO, time_constant=P(10.0, "s", 1e-9)):
    """G, Fv scaled by 1 + a (1 - exp(-t/tau)).

    t is the time of the log; the drive is cold until t = 0. In a log: all friction drifts
    towards a new level, a < 0 as grease warms up. A log much shorter than tau shows a straight
    drift, from which a and tau cannot be determined separately; a log that starts with a warm
    drive shows none.
    """
    return ratio * (1.0 - np.exp(-np.maximum(t, 0.0) / time_constant))


@block(
    "effect",
    out="level",
    acts="+Fc +Fs",
    confused="position_dependent_friction torque_ripple gravity",
    experiment="repeat the run with another payload: load-dependent friction changes with it",
)
def load_dependent_friction(load, coefficient=P(0.0, "1", 0.0, 20.0, neutral=0.0)):
    """Fc + mu |load|, Fs + mu |load|.

    ``load`` is the sum of d and the torques of gravity and a constant torque, not the motor
    torque. In a log: friction is higher where the load is large, whatever its sign; with gravity
    twice per turn, as position-dependent friction of order N = 2. A constant load only shifts
    Fc: no log distinguishes the two.
    """
    return coefficient * np.abs(load)


@block(
    "effect",
    out="level",
    acts="Fc Fs",
    confused="thermal_drift inertia_step",
    experiment="repeat the run, check whether the change recurs, and log the temperature",
)
def friction_step(t, ratio=RATIO, time=P(0.0, "s")):
    """G = 1 + a from t0.

    In a log: the residual torque times sign(w) jumps at one time. A drift that is faster than
    the moves in the log looks the same.
    """
    return ratio * np.where(t >= time, 1.0, 0.0)
