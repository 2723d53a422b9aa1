"""Effects on the torque between the command and the motor."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..block import P
from ..declaration import block
from .loads import PHASE


def held_late(u: np.ndarray, dt: float, delay: float) -> np.ndarray:
    """u(t - T) of an input held over cells of length dt, averaged over each cell."""
    whole, part = divmod(max(delay, 0.0) / dt, 1.0)
    index = np.arange(len(u)) - int(whole)
    late, later = u[np.maximum(index, 0)], u[np.maximum(index - 1, 0)]
    return (1.0 - part) * late + part * later


def held_lagging(u: np.ndarray, dt: float, time_constant: float) -> np.ndarray:
    """A first-order lag of an input held over cells of length dt, averaged over each cell.

    Before the first sample the lag has settled at the first value.
    """
    if time_constant <= 0.0:
        return u
    from scipy.signal import lfilter  # slow to import

    left = np.exp(-dt / time_constant)
    ends, _ = lfilter([1.0 - left], [1.0, -left], u, zi=[left * u[0]])
    begins = np.append(u[:1], ends[:-1])
    return u + (begins - u) * (1.0 - left) * time_constant / dt


def _is_signal(state: Any, delay: Any) -> bool:
    """Whether the engine keeps the past of u: the state is then u(t - T), and its rate says u."""
    graph = getattr(state, "graph", None)
    if graph is None:
        return False
    graph.late[state.index] = delay
    return state.index in graph.exact


@block(
    "effect",
    out="u",
    states="p1 p2",
    start="u 0",
    acts="input",
    confused="actuator_lag velocity_sensor_lag elastic_coupling",
    experiment="record a torque chirp: the phase lag of a delay grows linearly with frequency",
    exact=held_late,
)
def input_delay(u, p1, p2, delay: Any = P(0.0, "s", 0.0, 0.2, neutral=0.0)):
    """u(t - T).

    In ``lg.simulate``, and along a log for a held input, the delay is exact; elsewhere
    (python-control) the block is the Pade approximation of order 2,
    1 - 12 s T/(s^2 T^2 + 6 s T + 12), exact to 1 degree of phase up to w T = 1.7. In a log:
    the motion follows the torque late, by the same time at all frequencies. An actuator lag with
    tau = T looks the same if the torque changes little within T. The torque of a log counts as
    held from each sample to the next: where it was read at instants, as from a current sensor, T
    comes out half a sample short.
    """
    if _is_signal(p1, delay):
        return p1, u, 0.0
    rate = np.where(delay > 0.0, 1.0 / np.maximum(delay, 1e-12), 0.0)
    return u - p2, rate * p2, rate * (12.0 * (u - p1) - 6.0 * p2)


@block(
    "effect",
    out="u",
    states="lagged",
    start="u",
    acts="input",
    confused="input_delay velocity_sensor_lag",
    experiment="record a torque chirp to well above 1/tau, and log the measured current",
    exact=held_lagging,
)
def actuator_lag(u, lagged, time_constant: Any = P(0.0, "s", 0.0, 10.0, neutral=0.0)):
    """tau du'/dt + u' = u.

    The current loop as a first-order lag; tau = 0 passes u unchanged. In a log: fast changes of
    the torque arrive late and smaller. Well below 1/tau it looks like a delay.
    """
    rate = np.where(time_constant > 0.0, 1.0 / np.maximum(time_constant, 1e-12), 0.0)
    return np.where(time_constant > 0.0, lagged, u), rate * (u - lagged)


@block(
    "effect",
    out="u",
    acts="input",
    confused="quadratic_drag sublinear_viscous",
    experiment="record the same move at increasing torques, up to the highest",
)
def actuator_saturation(u, limit: Any = P(np.inf, "N m", 0.0, neutral=np.inf)):
    """u' = clip(u, -limit, limit).

    In a log: the residual is zero until the commanded torque exceeds the limit, and equals the
    excess above it. If a log exceeds the limit only at high speed, drag looks the same.
    """
    return np.clip(u, -limit, limit)


@block(
    "effect",
    out="u",
    acts="input",
    confused="coulomb_asymmetry backlash stribeck",
    experiment="speed up and brake at torques just above friction: the loss follows the sign of "
    "the torque, not of the speed",
)
def actuator_dead_zone(u, half_width: Any = P(0.0, "N m", 0.0, neutral=0.0)):
    """u' = u - clip(u, -half_width, half_width).

    The torque is reduced by half_width towards 0. In a log: a constant loss that opposes the
    torque. While torque and speed have the same sign, higher Coulomb friction looks the same;
    only braking distinguishes them.
    """
    return u - np.clip(u, -half_width, half_width)


@block(
    "effect",
    out="u",
    acts="input",
    confused="torque_ripple position_dependent_friction",
    experiment="repeat the same slow path under two loads: this ripple grows with the torque",
)
def torque_constant_ripple(
    u,
    theta,
    ratio=P(0.0, "1", 0.0, 0.95, neutral=0.0),
    harmonic=P(2.0, "1/rev", 1e-3, 1e9, whole=True),
    phase=PHASE,
):
    """u' = u (1 + a sin(N theta + phi)).

    N >= 1 on rotary drives; on linear drives N = 2 pi / period in rad/m. In a log: a spectral
    line at an order of the position, proportional to the torque. If the torque is mostly Coulomb
    friction, it changes sign with the direction, as position-dependent friction does; under a
    large constant load it looks like a torque ripple.
    """
    return u * (1.0 + ratio * np.sin(harmonic * theta + phase))
