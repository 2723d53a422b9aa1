"""Effects that change the level of friction: with direction, position, load or time."""

from __future__ import annotations

import numpy as np

from ...spec import P, block
from . import hints
from .loads import PHASE

RATIO = P(0.0, "1", -0.95, 20.0, neutral=0.0)


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
    harmonic=P(1.0, "1/rev", 1e-3, 1e9, grid=hints.orders, whole=True),
    phase=PHASE,
):
    """G = 1 + a sin(N theta + phi).

    N >= 1 on rotary drives; on linear drives N = 2 pi / period in rad/m. In a log: a line at an
    order of the position whose sign turns with the direction (a bent shaft, a tight spot in a
    guide). In one direction only it is a torque ripple or gravity.
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

    In a log: a constant torque while the drive moves that is gone while it rests. In a log
    that hardly rests it is a constant torque.
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

    In a log: a residual that grows with speed and has one sign in both directions. At a single
    speed it is an asymmetry of Coulomb friction.
    """
    return ratio * np.sign(w)


@block(
    "effect",
    out="level",
    acts="Fc Fs Fv",
    confused="friction_step quadratic_drag",
    experiment="repeat the same run cold and warm, at two speeds in turn, and log the temperature",
)
def thermal_drift(
    t,
    ratio=RATIO,
    time_constant=P(10.0, "s", 1e-9, grid=hints.durations),
):
    """G, Fv scaled by 1 + a (1 - exp(-t/tau)).

    t is the time of the log, at whose 0 the drive is cold; before that nothing changes. In a
    log: all friction drifts towards a new level, a < 0 as grease warms up. A log much shorter
    than tau shows a straight drift, from which a and tau cannot be told apart; a log that
    starts warm shows none.
    """
    return ratio * (1.0 - np.exp(-np.maximum(t, 0.0) / time_constant))


@block(
    "effect",
    out="level",
    acts="+Fc +Fs",
    confused="position_dependent_friction torque_ripple gravity",
    experiment="repeat the run with another payload: friction that hangs on the load follows it",
)
def load_dependent_friction(load, coefficient=P(0.0, "1", 0.0, 20.0, neutral=0.0)):
    """Fc + mu |load|, Fs + mu |load|.

    ``load`` is d and the torques of gravity and a constant torque, not what the motor has to
    give. In a log: friction grows where the load pulls, in both of its directions; with gravity
    at every half turn, which friction that hangs on position (N = 2) resembles. A constant load
    only shifts Fc: no log tells the two.
    """
    return coefficient * np.abs(load)


@block(
    "effect",
    out="level",
    acts="Fc Fs",
    confused="thermal_drift inertia_step",
    experiment="repeat the run and see whether the change comes back; log the temperature",
)
def friction_step(t, ratio=RATIO, time=P(0.0, "s", grid=hints.instants)):
    """G = 1 + a from t0.

    In a log: the residual torque along sign(w) jumps at one time. A drift faster than the
    moves in the log looks alike.
    """
    return ratio * np.where(t >= time, 1.0, 0.0)
