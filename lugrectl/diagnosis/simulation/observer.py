"""The steady Kalman gain with which an observer corrects the motion of a drive."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg import expm

Rows = tuple[tuple[float, ...], ...]
Sensing = tuple[Rows, Rows, Rows, Rows]
DOUBLINGS = 60


@lru_cache(maxsize=512)
def observer_gain(
    dt: float, jump: float, noise: tuple[float, float], sensing: Sensing
) -> tuple[np.ndarray, np.ndarray]:
    """Gain (2 + n, 2) and innovation covariance (2, 2) of dtheta/dt = w, dw/dt = noise.

    Sensors with n states s: ds/dt = A s + B (theta, w), y = C s + D (theta, w) + noise; ``sensing``
    are A, B, C, D as nested tuples. ``jump`` is the standard deviation of dw/dt, independent from
    sample to sample, rad/s2: that of the torque over J. ``noise`` is that of y, rad and rad/s, nan
    where not recorded: there the gain is 0 and the covariance 1. Do not write into the arrays.
    """
    n, seen = 2 + len(sensing[0]), np.flatnonzero(np.isfinite(noise))
    shapes = (n - 2, n - 2), (n - 2, 2), (2, n - 2), (2, 2)
    A, B, C, D = (np.reshape(m, shape) for m, shape in zip(sensing, shapes, strict=True))
    flow = np.zeros((n + 1, n + 1))  # the last state is the jump of dw/dt
    flow[0, 1] = flow[1, n] = 1.0
    flow[2:n, :2], flow[2:n, 2:n] = B, A
    step, H, size = expm(flow * dt), np.hstack([D, C])[seen], np.array(noise)[seen]
    kept = np.arange(0 if 0 in seen else 1, n)  # theta is unobservable if not recorded
    scale = np.full(n, noise[0] / dt if 0 in seen else noise[1])  # else it is ill-conditioned
    scale[0] *= dt
    a, push = step[:n, :n] * scale / scale[:, None], jump * step[:n, n] / scale
    P = np.zeros((n, n))
    both = np.ix_(kept, kept)
    P[both] = _riccati(a[both], (H * scale / size[:, None])[:, kept], np.outer(push, push)[both])
    P *= np.outer(scale, scale)
    S = H @ P @ H.T + np.diag(size**2)
    gain, covariance = np.zeros((n, 2)), np.eye(2)
    gain[:, seen], covariance[np.ix_(seen, seen)] = P @ H.T @ np.linalg.inv(S), S
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
