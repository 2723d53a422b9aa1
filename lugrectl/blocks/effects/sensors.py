"""Effects of the sensors: inputs w, theta, outputs w_m, theta_m."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..block import P
from ..declaration import block
from .loads import PHASE


@block(
    "effect",
    out="w_m theta_m",
    states="lagged",
    start="w",
    acts="sensor",
    confused="input_delay actuator_lag elastic_coupling",
    experiment="also record the raw position and differentiate it: the lag is between the two",
)
def velocity_sensor_lag(w, theta, lagged, time_constant: Any = P(0.0, "s", 0.0, 10.0, neutral=0.0)):
    """tau dw_m/dt + w_m = w.

    The filter of a tachometer or of a differentiated encoder; theta_m = theta. In a log: friction
    over w has loops whose direction changes with the sign of the acceleration, and w differs
    from dtheta/dt if theta was recorded. Without theta a delay of the torque looks the same.
    """
    lags = time_constant > 0.0
    rate = np.where(lags, 1.0 / np.maximum(time_constant, 1e-12), 0.0)
    return np.where(lags, lagged, w), theta, rate * (w - lagged)


@block(
    "effect",
    out="w_m theta_m",
    acts="sensor",
    confused="torque_ripple pose_dependent_inertia gravity",
    experiment="record two constant speeds: the ripple of w grows with the speed, that of a "
    "torque does not",
)
def encoder_eccentricity(w, theta, amplitude=P(0.0, "rad", 0.0, 0.9, neutral=0.0), phase=PHASE):
    """theta_m = theta + A sin(theta + phi), w_m = w (1 + A cos(theta + phi)).

    w_m is the derivative of theta_m; with A < 1 it has the sign of w. In a log: one period per
    turn, as large as a torque J A w^2, so that slow turns do not show it. At one speed gravity
    looks the same. A is an angle of the drive's turn; it has no meaning on a linear drive.
    """
    angle = theta + phase
    return w * (1.0 + amplitude * np.cos(angle)), theta + amplitude * np.sin(angle)
