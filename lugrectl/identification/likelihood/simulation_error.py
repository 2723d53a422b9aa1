"""Simulation error of a model on samples it has not seen, and the disturbance torque that an
observer estimates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from ...core.numeric import rms
from ..dataset.kalman import Noise
from ..dataset.windows import Windows
from .predictor import Predictor, Values


@dataclass(frozen=True)
class Judged:
    """Errors of one model: RMS with restarts, RMS of the residual torque, simulated signal."""

    error: float
    torque: float
    simulated: np.ndarray


def judge(
    predictor: Predictor, values: Values, noise: Noise, test: Windows, yardstick: Noise
) -> Judged:
    """Simulate each held-out window from the recorded torque alone.

    The residual torque is the disturbance estimate of the observer with the gain of ``yardstick``.
    """
    simulated = restarted(predictor, values, noise, test)
    measured = predictor.data.measured[test.counted]
    torque = missing_torque(predictor, values, test, yardstick)
    return Judged(rms(measured - simulated), rms(torque), simulated)


def restarted(predictor: Predictor, values: Values, noise: Noise, where: Windows) -> np.ndarray:
    """Each window simulated from the torque alone, (windows, length).

    The state at the start of a window comes from the observer, run over the lead-in before it.
    """
    lead = Windows(where.start, 0, where.burn)
    _, x = predictor.run([values], lead, noise)
    window = Windows(where.start + where.burn, 0, where.length)
    y, _ = predictor.run([values], window, noise, corrected=False, x0=x[0])
    return y[0, ..., predictor.data.channel]


def missing_torque(
    predictor: Predictor, values: Values, where: Windows, noise: Noise
) -> np.ndarray:
    """Torque missing on the resisting side, (windows, length), as the observer estimates it."""
    y, _ = predictor.run([values], where, noise)
    e = np.nan_to_num(predictor.data.y[where.counted] - y[0])
    K, _ = predictor.filter(noise, values)
    return -values["J"] / predictor.data.dt * (e @ K[1])


def sensed_torque(predictor: Predictor, values: Values, noise: Noise) -> float:
    """RMS that the sensors' own noise alone gives the residual torque of single samples, N m.

    With the gain K of the observer and white noise v of covariance R, and a model that is right,

        x+ = A (I - K C) x + A K v,  torque = J / dt * K_w (v - C x),  A = [1 dt; 0 1]

    of which this is the stationary solution. R is the noise that the error of the motion is
    compared with; that of ``noise`` is larger where counts repeat.
    """
    dt, seen = predictor.data.dt, noise.recorded()
    K = predictor.filter(noise, values)[0][:2, seen]
    A, C = np.array([[1.0, dt], [0.0, 1.0]]), np.eye(2)[seen]
    R = np.diag(np.array(predictor.data.own)[seen] ** 2)
    at = slice(0 if noise.channels()[0] else 1, 2)  # theta is unobservable if not recorded
    F, G, own = (A @ (np.eye(2) - K @ C))[at, at], (A @ K)[at], C[:, at]
    P = np.asarray(solve_discrete_lyapunov(F, G @ R @ G.T))
    size = K[1] @ (own @ P @ own.T + R) @ K[1]
    return float(values["J"] / dt * np.sqrt(max(size, 0.0)))


def free_run(
    predictor: Predictor, values: Values, noise: Noise, runs: Sequence[tuple[int, int]]
) -> float:
    """RMS error of the simulation without restarts over whole runs."""
    channel, squares, count = predictor.data.channel, 0.0, 0
    for a, b in runs:
        y, _ = predictor.run([values], Windows(np.array([a]), 0, b - a), noise, corrected=False)
        e = predictor.data.measured[a:b] - y[0, 0, :, channel]
        squares, count = squares + float(e @ e), count + len(e)
    return float(np.sqrt(squares / count))
