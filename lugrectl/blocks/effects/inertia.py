"""Inertia that changes, and inertia behind a spring."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..block import P
from ..declaration import block
from ..friction import EPS, J
from .levels import RATIO
from .loads import PHASE

SHARED_J: Any = replace(J, shared=True)
LOAD: Any = P(0.0, "kg m2", 0.0, neutral=0.0)
STIFFNESS: Any = P(10.0, "N m/rad", 0.0)
DAMPING: Any = P(0.01, "N m s/rad", 0.0)


@block(
    "effect",
    out="level",
    acts="J",
    confused="friction_step pose_dependent_inertia",
    experiment="accelerate and brake along the same path before and after the change",
)
def inertia_step(t, ratio=RATIO, time=P(0.0, "s")):
    """J (1 + a) from t0.

    A payload picked up or put down at the speed of the drive. In a log: from one time on the
    residual torque is proportional to the acceleration. If all moves are alike, a step of
    friction looks the same.
    """
    return ratio * np.where(t >= time, 1.0, 0.0)


@block(
    "effect",
    out="level d",
    acts="J torque",
    confused="inertia_step gravity encoder_eccentricity torque_ripple",
    experiment="run through the same positions at two accelerations and at a constant high speed",
)
def pose_dependent_inertia(
    theta,
    w,
    ratio=P(0.0, "1", 0.0, 0.9, neutral=0.0),
    harmonic=P(1.0, "1/rev", 1e-3, 1e9, whole=True),
    phase=PHASE,
    J=SHARED_J,
):
    """J(theta) = J (1 + a cos(N theta + phi)), r_e = (1/2) dJ/dtheta w^2.

    The torque r_e belongs to the change of J: together they conserve the kinetic energy. N = 1 is
    an arm with an elbow, N = 2 a crank; on linear drives N = 2 pi / period in rad/m. In a log:
    the residual is proportional to the acceleration, by a factor that depends on position, and
    at constant speed to w^2, as for an eccentric encoder. At one acceleration gravity or a
    ripple looks the same. A model may contain only one such effect.
    """
    angle = harmonic * theta + phase
    return ratio * np.cos(angle), -0.5 * J * ratio * harmonic * np.sin(angle) * w * w


def _stretched(twist: Any, gap: Any) -> Any:
    """The stretch of a coupling with a gap of this total width."""
    return np.maximum(twist - 0.5 * gap, 0.0) + np.minimum(twist + 0.5 * gap, 0.0)


def _load_side(
    motion: tuple[Any, Any, Any], load_inertia: Any, gap: Any, k: Any, c: Any, slowed: Any = 0.0
):
    """Torque on the motor and the rates of twist and load speed; all 0 without a load.

    ``motion`` holds w, twist and w_load, ``slowed`` is the torque of the load's own friction.
    """
    w, twist, w_load = motion
    there = load_inertia > 0.0
    touching = np.abs(twist) >= 0.5 * gap
    torque = k * _stretched(twist, gap) + np.where(touching, c * (w - w_load), 0.0)
    torque = np.where(there, torque, 0.0)
    return (
        torque,
        np.where(there, w - w_load, 0.0),
        np.where(there, torque - slowed, 0.0) / np.where(there, load_inertia, 1.0),
    )


def load_motion(theta: Any, w: Any, twist: Any, w_load: Any, load_inertia: Any) -> tuple[Any, Any]:
    """Position and speed of a load behind a coupling; those of the motor without a load."""
    there = load_inertia > 0.0
    return np.where(there, theta - twist, theta), np.where(there, w_load, w)


@block(
    "effect",
    out="d",
    states="twist w_load",
    start="0 w",
    acts="torque",
    confused="input_delay velocity_sensor_lag backlash presliding",
    experiment="record a torque chirp through the resonance, with an encoder on the load if any",
)
def elastic_coupling(w, twist, w_load, load_inertia=LOAD, stiffness=STIFFNESS, damping=DAMPING):
    """r_e = K twist + D (w - w_load), Jl dw_load/dt = r_e, dtwist/dt = w - w_load.

    A load inertia Jl in addition to J, behind a spring and a damper; friction acts on the motor.
    The states are 0 and w if both turn together. In a log: the motor hardly moves at
    sqrt(K/Jl) (anti-resonance) and moves most at sqrt(K (1/J + 1/Jl)) (resonance). Well below
    that a larger J looks the same; near it a sensor lag or a delay has a similar phase.
    """
    return _load_side((w, twist, w_load), load_inertia, 0.0, stiffness, damping)


@block(
    "effect",
    out="d",
    states="twist w_load",
    start="0 w",
    acts="torque",
    confused="elastic_coupling presliding actuator_dead_zone",
    experiment="reverse slowly and fast at several amplitudes: the gap is a fixed angle",
)
def backlash(
    w,
    twist,
    w_load,
    load_inertia=LOAD,
    gap=P(0.01, "rad", 0.0),
    stiffness=STIFFNESS,
    damping=DAMPING,
    load_friction: Any = P(0.0, "N m", 0.0, usual=True),
    eps=EPS,
):
    """r_e = K s + D (w - w_load), s = twist beyond +-gap/2, Jl dw_load/dt = r_e.

    dtwist/dt = w - w_load; no torque while |twist| < gap/2; gap is the total width. twist = 0
    is the middle of the gap. With dry friction Fl of the load's own,
    Jl dw_load/dt = r_e - Fl sign(w_load): the load stays where the drive left it, where without
    friction it flies on through the gap. In a log: after each reversal the drive moves with J alone
    over a fixed angle, then hits the load. With a gap of 0 it is an elastic coupling; at one small
    amplitude presliding may look the same.
    """
    slowed = load_friction * np.tanh(w_load / eps)
    return _load_side((w, twist, w_load), load_inertia, gap, stiffness, damping, slowed)
