"""Torques on the resisting side that depend on position or time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..block import P
from ..declaration import block

PHASE: Any = P(0.0, "rad", -np.pi, np.pi, span=(0.0, np.pi / 2), angle=True)
AMPLITUDE: Any = P(0.0, "N m", 0.0, neutral=0.0)


@block(
    "effect",
    out="d",
    acts="torque",
    load=True,
    confused="coulomb_asymmetry gravity return_spring",
    experiment="record a hold at zero torque and the same slow move in both directions",
)
def constant_torque(t, torque=P(0.0, "N m", neutral=0.0)):
    """r_e = T0.

    In a log: the mean of the residual torque, the same in both directions and at rest: a
    suspended load, or an offset of the current sensor. Over a short travel gravity and a return
    spring look the same; an asymmetry of friction vanishes at rest.
    """
    return torque + 0.0 * t


@block(
    "effect",
    out="d",
    acts="torque",
    load=True,
    confused="constant_torque return_spring torque_ripple",
    experiment="record slow moves over at least one whole turn in both directions",
)
def gravity(theta, amplitude=AMPLITUDE, phase=PHASE):
    """r_e = A sin(theta + phi).

    In a log: one period per turn, the same in both directions and at every speed. Over less than
    a quarter turn a constant torque with a return spring looks the same.
    """
    return amplitude * np.sin(theta + phase)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="periodic_disturbance position_dependent_friction torque_constant_ripple "
    "encoder_eccentricity",
    experiment="record slow moves over several periods, at two speeds and in both directions",
)
def torque_ripple(
    theta, amplitude=AMPLITUDE, harmonic=P(2.0, "1/rev", 1e-3, 1e9, whole=True), phase=PHASE
):
    """r_e = A sin(N theta + phi).

    N >= 2 on rotary drives (N = 1 is gravity); on linear drives N = 2 pi / period in rad/m. In a
    log: a spectral line at a fixed order of the position, the same in both directions and at
    every torque (cogging). At one constant speed a periodic disturbance looks the same; in one
    direction position-dependent friction; at one torque a ripple of the torque constant.
    """
    return amplitude * np.sin(harmonic * theta + phase)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="gravity constant_torque",
    experiment="record slow moves over the whole travel, in both directions, at two frequencies",
)
def return_spring(
    theta, stiffness: Any = P(0.0, "N m/rad", 0.0, neutral=0.0), rest=P(0.0, "rad", span=(0.0, 1.0))
):
    """r_e = K (theta - theta0).

    In a log: a torque that is linear in the position, the same in both directions (a cable, a
    torsion spring). Over a short travel gravity looks the same; with a single sine as the motion,
    so does inertia.
    """
    return stiffness * (theta - rest)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="return_spring gravity",
    experiment="move slowly into the end of the travel and back, twice",
)
def hard_stop(
    theta,
    position=P(0.0, "rad", passed=True),
    stiffness: Any = P(0.0, "N m/rad", 0.0, neutral=0.0),
    side: Any = P(1.0, "1", -1.0, 1.0, choices=(-1.0, 1.0)),
):
    """r_e = K (theta - thetas) beyond thetas, side (theta - thetas) > 0.

    side = +1 stops positive motion, -1 negative. The stop is elastic, without loss. In a log: a
    torque on one side of one position and none on the other. If the drive only just reaches the
    stop, a spring or gravity near the end of the travel looks the same.
    """
    return side * stiffness * np.maximum(side * (theta - position), 0.0)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="torque_ripple",
    experiment="repeat the run at another speed and at standstill: a fixed frequency does not "
    "change",
)
def periodic_disturbance(
    t, amplitude=AMPLITUDE, frequency: Any = P(1.0, "Hz", 1e-9, 1e6), phase=PHASE
):
    """r_e = A sin(2 pi f t + phi).

    In a log: a spectral line at a fixed frequency at any speed (mains, a neighbouring machine).
    At one constant speed a ripple over position looks the same. phi is the phase at t = 0 of the
    log.
    """
    return amplitude * np.sin(2 * np.pi * frequency * t + phase)
