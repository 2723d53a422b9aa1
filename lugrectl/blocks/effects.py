"""Physical effects that a declared model may lack: one function and one registry line each.

Torque effects put out ``d``, the torque that they add to the resisting side. Level effects put
out the relative change of the friction parameters that ``acts`` names. Input effects put out
the torque that reaches the drive. At the neutral value of its gain an effect changes nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..spec import P, block

PHASE = P(0.0, "rad", -np.pi, np.pi, span=(0.0, np.pi / 2), angle=True)
AMPLITUDE = P(0.0, "N m", 0.0, neutral=0.0)
RATIO = P(0.0, "1", -0.95, 20.0, neutral=0.0)


def _harmonics(log: Any) -> np.ndarray:
    """Whole orders of a turn; on a linear drive half a resolution cell of the travel apart."""
    if log.motion == "linear":
        return np.pi / np.ptp(log.theta) * np.arange(4.0, 400.0)
    return np.arange(2.0, 97.0)


def _frequencies(log: Any) -> np.ndarray:
    """Half a resolution cell apart, from three periods in the log to a tenth of the rate."""
    length = log.t[-1] - log.t[0]
    return np.arange(3.0 / length, min(0.1 / log.dt, 120.0), 0.5 / length)


def _instants(log: Any) -> np.ndarray:
    """Times that leave a tenth of the log on either side."""
    return log.t[0] + (log.t[-1] - log.t[0]) * np.linspace(0.1, 0.9, 33)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="coulomb_asymmetry gravity return_spring",
    experiment="record a hold at zero torque and the same slow move in both directions",
)
def constant_torque(t, torque=P(0.0, "N m", neutral=0.0)):
    """r_e = T0."""
    return torque + 0.0 * t


@block(
    "effect",
    out="d",
    acts="torque",
    confused="constant_torque return_spring torque_ripple",
    experiment="record slow moves over at least one whole turn in both directions",
)
def gravity(theta, amplitude=AMPLITUDE, phase=PHASE):
    """r_e = A sin(theta + phi)."""
    return amplitude * np.sin(theta + phase)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="periodic_disturbance position_dependent_friction encoder_eccentricity",
    experiment="record slow moves over several periods at two different speeds, both ways",
)
def torque_ripple(
    theta,
    amplitude=AMPLITUDE,
    harmonic=P(2.0, "1/rev", 2.0, 1e6, grid=_harmonics, whole=True),
    phase=PHASE,
):
    """r_e = A sin(N theta + phi).

    N >= 2 on rotary drives (N = 1 is gravity); on linear drives N = 2 pi / period in rad/m.
    """
    return amplitude * np.sin(harmonic * theta + phase)


@block(
    "effect",
    out="level",
    acts="Fc Fs",
    confused="constant_torque viscous_asymmetry",
    experiment="record the same slow move in both directions, with holds at zero torque between",
)
def coulomb_asymmetry(w, ratio=P(0.0, "1", -0.95, 0.95, neutral=0.0)):
    """G = 1 + a sign(w)."""
    return ratio * np.sign(w)


@block(
    "effect",
    out="level",
    acts="Fv",
    confused="quadratic_drag coulomb_asymmetry",
    experiment="record constant speeds, slow to fast, in both directions",
)
def viscous_asymmetry(w, ratio=P(0.0, "1", -1.0, 1.0, neutral=0.0)):
    """Fv (1 + a sign(w))."""
    return ratio * np.sign(w)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="viscous_asymmetry thermal_drift",
    experiment="record constant speeds up to the highest that the drive allows, then a coast-down",
)
def quadratic_drag(w, coefficient: Any = P(0.0, "N m s2/rad2", 0.0, neutral=0.0)):
    """r_e = c w |w|."""
    return coefficient * w * np.abs(w)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="gravity constant_torque",
    experiment="record slow moves over the whole travel, in both directions, at two frequencies",
)
def return_spring(
    theta,
    stiffness=P(0.0, "N m/rad", 0.0, neutral=0.0),
    rest=P(0.0, "rad", span=(0.0, 1.0)),
):
    """r_e = K (theta - theta0)."""
    return stiffness * (theta - rest)


@block(
    "effect",
    out="d",
    acts="torque",
    confused="torque_ripple",
    experiment="repeat the run at another speed and once at standstill: a fixed frequency stays",
)
def periodic_disturbance(
    t,
    amplitude=AMPLITUDE,
    frequency: Any = P(1.0, "Hz", 1e-9, 1e6, grid=_frequencies),
    phase=PHASE,
):
    """r_e = A sin(2 pi f t + phi)."""
    return amplitude * np.sin(2 * np.pi * frequency * t + phase)


@block(
    "effect",
    out="level",
    acts="Fc Fs",
    confused="thermal_drift inertia_step",
    experiment="repeat the run and see whether the change comes back; log the temperature",
)
def friction_step(t, ratio: Any = RATIO, time=P(0.0, "s", grid=_instants)):
    """G = 1 + a from t0."""
    return ratio * np.where(t >= time, 1.0, 0.0)


def held_late(u: np.ndarray, dt: float, delay: float) -> np.ndarray:
    """u(t - T) of an input held over cells of length dt, averaged over each cell."""
    whole, part = divmod(max(delay, 0.0) / dt, 1.0)
    index = np.arange(len(u)) - int(whole)
    late, later = u[np.maximum(index, 0)], u[np.maximum(index - 1, 0)]
    return (1.0 - part) * late + part * later


@block(
    "effect",
    out="u",
    states="p1 p2",
    acts="input",
    confused="actuator_lag velocity_sensor_lag",
    experiment="record a torque chirp: the phase lag of a delay grows linearly with frequency",
    exact=held_late,
)
def input_delay(u, p1, p2, delay: Any = P(0.0, "s", 0.0, 0.2, neutral=0.0)):
    """u(t - T).

    On a held input the delay is exact; the continuous block is the Pade approximation of order
    2, 1 - 12 s T/(s^2 T^2 + 6 s T + 12), good to 1 degree of phase up to w T = 1.7.
    """
    rate = np.where(delay > 0.0, 1.0 / np.maximum(delay, 1e-12), 0.0)
    return u - p2, rate * p2, rate * (12.0 * (u - p1) - 6.0 * p2)
