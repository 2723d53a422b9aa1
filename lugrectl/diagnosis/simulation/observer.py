"""The steady Kalman gain with which an observer corrects the motion of a drive."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg import expm

Rows = tuple[tuple[float, ...], ...]
DOUBLINGS = 60


@lru_cache(maxsize=512)
def observer_gain(
    dt: float, jump: float, noise: tuple[float, float], sensing: tuple[Rows, Rows, Rows, Rows]
) -> tuple[np.ndarray, np.ndarray]:
    """Gain and innovation covariance for dtheta/dt = w, dw/dt = noise of each sample.

    Sensors with states s: ds/dt = A s + B (theta, w), y = C s + D (theta, w).

    Parameters
    ----------
    dt : float
        Step, s.
    jump : float
        Standard deviation of dw/dt, independent from sample to sample, rad/s2: that of the torque
        over J.
    noise : tuple of two floats
        Of the measured theta and w, rad and rad/s; nan where not recorded.
    sensing : tuple
        A (s, s), B (s, 2), C (2, s), D (2, 2) as nested tuples.

    Returns
    -------
    gain : (2 + s, 2) array
        From the innovations to theta, w, s; the column of a channel that was not recorded is 0.
    covariance : (2, 2) array
        Of the innovations; 1 on the diagonal where nothing was recorded.

    Notes
    -----
    Results are cached: do not write into the arrays.
    """
    many, seen = len(sensing[0]), np.flatnonzero(np.isfinite(noise))
    A, B, C, D = (
        np.array(rows, float).reshape(shape)
        for rows, shape in zip(sensing, ((many, many), (many, 2), (2, many), (2, 2)), strict=True)
    )
    n = 2 + many
    flow = np.zeros((n + 1, n + 1))  # the last state is the jump of dw/dt
    flow[0, 1] = flow[1, n] = 1.0
    flow[2:n, :2], flow[2:n, 2:n] = B, A
    step, H = expm(flow * dt), np.hstack([D, C])[seen]
    kept = np.arange(0 if 0 in seen else 1, n)  # theta is unobservable if not recorded
    size = np.array(noise)[seen]
    scale = np.full(n, noise[0] / dt if 0 in seen else noise[1])
    scale[0] *= dt
    a = (step[:n, :n] * scale / scale[:, None])[np.ix_(kept, kept)]
    push = (jump * step[:n, n] / scale)[kept]
    h = (H * scale / size[:, None])[:, kept]
    P = np.zeros((n, n))
    P[np.ix_(kept, kept)] = _riccati(a, h, np.outer(push, push))
    P *= np.outer(scale, scale)
    gain, covariance = np.zeros((n, 2)), np.eye(2)
    S = H @ P @ H.T + np.diag(size**2)
    gain[:, seen] = P @ H.T @ np.linalg.inv(S)
    covariance[np.ix_(seen, seen)] = S
    return gain, covariance


def _riccati(A: np.ndarray, H: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """P = A (P^-1 + H' H)^-1 A' + Q by doubling, even if it is ill-conditioned.

    Chu, Fan and Lin, A structure-preserving doubling algorithm (2004), for the filter's form.
    """
    a, G, P = A.T, H.T @ H, Q
    for _ in range(DOUBLINGS):
        half = np.linalg.solve(np.eye(len(A)) + G @ P, np.hstack([a, G]))
        a_half, G_half = half[:, : len(A)], half[:, len(A) :]
        more = a.T @ P @ a_half
        a, G, P = a @ a_half, G + a @ G_half @ a.T, P + more
        if np.all(np.abs(more) <= 1e-12 * np.abs(P)):
            break
    return 0.5 * (P + P.T)
