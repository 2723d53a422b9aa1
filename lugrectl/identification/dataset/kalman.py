"""The steady-state Kalman gain of a motion with sensor noise, and its smoother."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm
from scipy.signal import filtfilt, lfilter

DOUBLINGS = 60


@dataclass(frozen=True)
class Noise:
    """Standard deviations of process noise and sensor noise.

    ``jump``: noise of dw/dt, independent from sample to sample (rad/s2), that is the torque's
    noise over J. ``theta`` (rad) and ``w`` (rad/s): noise of the sensors, nan where not recorded.
    """

    jump: float
    theta: float
    w: float

    def channels(self) -> np.ndarray:
        """True for those of theta, w that were recorded."""
        return np.isfinite([self.theta, self.w])

    def recorded(self) -> np.ndarray:
        """Indices of the recorded ones of theta, w."""
        return np.flatnonzero(self.channels())


Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Sensing:
    """Sensors with states s, linearised: ds/dt = A s + B (theta, w), output (theta, w) D' + s C'.

    Nested tuples, so that it can be a dictionary key.
    """

    A: Rows
    B: Rows
    C: Rows
    D: Rows


@lru_cache(maxsize=256)
def observer_gain(
    dt: float, noise: Noise, sensing: Sensing | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Steady-state Kalman gain of dw/dt = noise, dtheta/dt = w.

    Returns
    -------
    gain : (2 + s, 2) array
        From the innovations of theta, w to theta, w and the sensors' states; the column of a
        channel that was not recorded is 0.
    covariance : (2, 2) array
        Of the innovations; 1 on the diagonal where nothing was recorded.

    Notes
    -----
    Results are cached: do not write into the arrays.
    """
    seen = noise.recorded()
    if sensing is None:
        (P, R), H = _prediction_covariance(dt, noise), np.eye(2)[seen]
    else:
        P, H, R = _behind_sensors(dt, noise, sensing)
    gain, covariance = np.zeros((len(P), 2)), np.eye(2)
    S = H @ P @ H.T + R
    gain[:, seen] = P @ H.T @ np.linalg.inv(S)
    covariance[seen[:, None], seen] = S
    return gain, covariance


def _behind_sensors(
    dt: float, noise: Noise, sensing: Sensing
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance of predicted theta, w and sensor states; output matrix; sensor noise."""
    A, B, C, D = (np.array(rows, dtype=float) for rows in vars(sensing).values())
    n, seen = 2 + len(A), noise.recorded()
    flow = np.zeros((n + 1, n + 1))  # the last state is the jump of dw/dt
    flow[0, 1] = flow[1, n] = 1.0
    flow[2:n, :2], flow[2:n, 2:n] = B, A
    step = expm(flow * dt)
    H = np.hstack([D, C])[seen]
    R = np.diag(np.array([noise.theta, noise.w])[seen] ** 2)
    kept = np.arange(0 if noise.channels()[0] else 1, n)  # theta is unobservable if not recorded
    scale = noise.theta * np.ones(n) / dt if noise.channels()[0] else noise.w * np.ones(n)
    scale[0] *= dt
    a = (step[:n, :n] * scale / scale[:, None])[kept][:, kept]
    push = (noise.jump * step[:n, n] / scale)[kept]
    sizes = np.sqrt(np.diag(R))
    h = (H * scale / sizes[:, None])[:, kept]
    P = np.zeros((n, n))
    P[kept[:, None], kept] = _riccati(a, h, np.outer(push, push), np.eye(len(seen)))
    return P * np.outer(scale, scale), H, R


def _prediction_covariance(dt: float, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of the predicted theta, w, and that of the recorded channels' noise."""
    seen, jump = noise.channels(), noise.jump
    R = np.diag(np.array([noise.theta, noise.w])[seen] ** 2)
    if not seen[0]:
        q = (jump * dt) ** 2
        return np.diag([0.0, 0.5 * (q + np.sqrt(q**2 + 4.0 * q * R[0, 0]))]), R
    scale = noise.theta * np.array([1.0, 1.0 / dt])  # unscaled, it is too ill-conditioned
    push = np.array([0.5, 1.0]) * jump * dt**2 / noise.theta
    A, H = np.array([[1.0, 1.0], [0.0, 1.0]]), np.eye(2)[seen]
    P = _riccati(A, H, np.outer(push, push), R / np.outer(scale[seen], scale[seen]))
    return P * np.outer(scale, scale), R


def _riccati(A: np.ndarray, H: np.ndarray, Q: np.ndarray, R: np.ndarray) -> np.ndarray:
    """P = A (P^-1 + H' R^-1 H)^-1 A' + Q by doubling, even if it is ill-conditioned.

    Chu, Fan and Lin, A structure-preserving doubling algorithm (2004), for the filter's form.
    """
    a, G, P = A.T, H.T @ np.linalg.solve(R, H), Q
    for _ in range(DOUBLINGS):
        half: np.ndarray = np.linalg.solve(np.eye(len(A)) + G @ P, np.hstack([a, G]))
        a_half, G_half = half[:, : len(A)], half[:, len(A) :]
        more: np.ndarray = a.T @ P @ a_half
        a, G, P = a @ a_half, G + a @ G_half @ a.T, P + more
        if np.all(np.abs(more) <= 1e-12 * np.abs(P)):
            break
    return 0.5 * (P + P.T)


def smooth(y: np.ndarray, dt: float, noise: Noise) -> np.ndarray:
    """Smoothed theta and w of one run, (N, 2): Kalman filter of constant gain, then backward pass.

    Missing samples must have been filled. If theta was not recorded, it is the integral of w from
    0.
    """
    P, R = _prediction_covariance(dt, noise)
    if not noise.channels()[0]:
        gain = P[1, 1] / (P[1, 1] + R[0, 0])
        w = filtfilt([gain], [1.0, gain - 1.0], y[:, 1])
        return np.column_stack([dt * np.cumsum(w), w])
    K, _ = observer_gain(dt, noise)
    A = np.array([[1.0, dt], [0.0, 1.0]])
    C = (np.eye(2) - K * noise.channels()) @ P @ A.T @ np.linalg.inv(P)
    y = np.where(np.isfinite(y), y, 0.0)
    start = np.array([y[0, 0], y[0, 1] if noise.channels()[1] else (y[1, 0] - y[0, 0]) / dt])
    ahead = _along(A @ (np.eye(2) - K), (y @ (A @ K).T)[:-1], start)
    filtered = ahead + (y - ahead) @ K.T
    back = filtered[:-1] - ahead[1:] @ C.T
    return _along(C, back[::-1], filtered[-1])[::-1]


def _along(M: np.ndarray, pushed: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The states x_k+1 = M x_k + b_k from x_0 on, (N + 1, 2), for b (N, 2).

    By the theorem of Cayley and Hamilton, with b_-1 = x_0,
    x_k+1 = tr(M) x_k - det(M) x_k-1 + b_k + (M - tr(M)) b_k-1: one filter for both states.
    """
    b = np.vstack([start, pushed])
    before = np.vstack([np.zeros(2), b[:-1]])
    rest = M - np.trace(M) * np.eye(2)
    line = [1.0, -np.trace(M), np.linalg.det(M)]
    return np.asarray(lfilter([1.0], line, b + before @ rest.T, axis=0))
