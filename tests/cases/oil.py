"""A mass in oil, solved exactly."""

from __future__ import annotations

import functools

import numpy as np

import lugrectl as lg

J, FV = 2e-3, 0.02


@functools.cache
def _motion():
    """t, u, w and theta of J dw/dt = u - Fv w, u held, with noise on the motion."""
    dt, n, rng = 4e-3, 3000, np.random.default_rng(1)
    t = np.arange(n) * dt
    u = 0.3 * np.sin(4.4 * t) + 0.15 * np.sin(14.5 * t + 1.0) + 0.1 * np.sin(44.0 * t)
    w, theta, still = np.zeros(n), np.zeros(n), np.exp(-FV * dt / J)
    for k in range(n - 1):
        end = u[k] / FV
        w[k + 1] = end + (w[k] - end) * still
        theta[k + 1] = theta[k] + end * dt + (w[k] - w[k + 1]) * J / FV
    return t, u, w + 1e-2 * rng.standard_normal(n), theta + 1e-4 * rng.standard_normal(n)


def log() -> dict[str, np.ndarray]:
    """Its columns."""
    return {k: x.copy() for k, x in zip(("t", "u", "w", "theta"), _motion(), strict=True)}


def read(folder, columns) -> lg.Record:
    """The record of a text file of these columns."""
    path, head = folder / "run.csv", ",".join(columns)
    np.savetxt(path, np.c_[*columns.values()], "%.17g", ",", header=head, comments="")
    return lg.read_record(path)
