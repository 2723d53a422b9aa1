"""Derivatives and noise of sampled signals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

STRETCH = 25  # samples over which noise is one number


def slope(x: np.ndarray, dt: float) -> np.ndarray:
    """dx/dt (n, ...) of fourth order: at 200 Hz plain differences take 3 % off 10 Hz."""
    if len(x) < 2:
        return np.zeros(x.shape)
    d = np.gradient(x, dt, axis=0)
    if len(x) > 8:
        d[2:-2] = (8 * (x[3:-1] - x[1:-3]) - x[4:] + x[:-4]) / (12 * dt)
    return d


def bend(x: np.ndarray, dt: float) -> np.ndarray:
    """d2x/dt2 (n, ...) of fourth order."""
    d = slope(slope(x, dt), dt)
    if len(x) > 8:
        d[2:-2] = (16 * (x[3:-1] + x[1:-3]) - 30 * x[2:-2] - x[4:] - x[:-4]) / (12 * dt**2)
    return d


def cubic(x: np.ndarray, v: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and speeds (n, k) at these shares (k,) of the way to the next sample, by the cubic
    through positions x (n,) and speeds v (n,) a sample; beyond the end the speed stays."""
    rise, after = np.append(np.diff(x), v[-1]), np.append(v[1:], v[-1])
    second, third = 3 * rise - 2 * v - after, v + after - 2 * rise
    q, (x, v, second, third) = shares, (y[:, None] for y in (x, v, second, third))
    return x + q * (v + q * (second + q * third)), v + q * (2 * second + 3 * q * third)


def local_noise(x: np.ndarray, pieces: Sequence[slice], quantile: float) -> float:
    """A quantile, over short stretches, of the spread of third differences."""
    thirds = [np.diff(x[at], 3) for at in pieces]
    spread = [y[: len(y) // STRETCH * STRETCH].reshape(-1, STRETCH).std(axis=1) for y in thirds]
    return float(np.quantile(np.concatenate(spread), quantile))


def half_response(kernel: np.ndarray) -> float:
    """Frequency (rad per sample) at which a kernel's response falls to one half."""
    H = np.abs(np.fft.rfft(kernel, 4096))
    low = np.flatnonzero(H < 0.5 * H[0])
    return np.pi * (int(low[0]) if len(low) else 2048) / 2048
