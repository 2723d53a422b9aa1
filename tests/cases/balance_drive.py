"""A drive in a few lines for the tests of the torque balance: none of the package's code."""

from __future__ import annotations

import math

import numpy as np

J, FC, FV = 0.004, 0.12, 0.006
BRISTLE = 400.0  # N m/rad
FINE = 4e-4  # s


def simulate(u, dt, w0=0.0, theta0=0.0, load=None):
    """theta and w of J dw/dt = u - F - load(theta, w), u held over each sample; Dahl friction."""
    theta, w, z, steps = theta0, w0, 0.0, max(round(dt / FINE), 1)
    h, seen = dt / steps, []
    for torque in u:
        seen.append((theta, w))
        for _ in range(steps):
            end = math.copysign(FC / BRISTLE, w)
            next_z = end + (z - end) * math.exp(-BRISTLE * abs(w) * h / FC)
            friction = BRISTLE * (z + next_z) / 2 + 0.05 * (next_z - z) / h + FV * w
            extra = load(theta, w) if load else 0.0
            next_w = w + h * (torque - friction - extra) / J
            theta += h * (w + next_w) / 2
            w, z = next_w, next_z
    return np.array(seen).T


def torque(seconds, dt, seed=0, size=0.6):
    """A torque of sines and steps that reverses the motion."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds / dt)) * dt
    u = sum(size * 0.5 * np.sin(2 * np.pi * (f * t + rng.uniform())) for f in (0.5, 0.83, 1.9))
    steps = np.repeat(rng.uniform(-1, 1, int(seconds / 0.4) + 1), round(0.4 / dt))[: len(t)]
    return u + 0.3 * size * steps


def inside(estimate, truth):
    """Whether a 95 % interval covers the truth."""
    low, high = estimate.ci95
    return low <= truth <= high


def log_of(u, dt, theta=None, w=None):
    """The columns of a log."""
    motion = {"theta": theta, "w": w}
    log = {"t": np.arange(len(u)) * dt, "u": np.asarray(u)}
    return log | {k: x for k, x in motion.items() if x is not None}


def recorded(seconds=10.0, dt=2e-3, seed=0, counts=65536, load=None, **more):
    """A log of u and theta of the drive, theta from an encoder."""
    u = torque(seconds, dt, seed)
    theta, _ = simulate(u, dt, load=load, **more)
    step = 2 * np.pi / counts
    return log_of(u, dt, np.floor(theta / step) * step)


def noisy(seconds=8.0, dt=2e-3, load=None):
    """A log of u and theta of the drive, theta with white noise of 0.1 mrad."""
    u = torque(seconds, dt, seed=3)
    theta, _ = simulate(u, dt, load=load)
    return log_of(u, dt, theta + np.random.default_rng(0).normal(0.0, 1e-4, len(u)))
