"""Drives and their logs, simulated by equations of our own: nothing here is of the package.

J dw/dt = u - F, F = sigma0 z + sigma1 dz/dt + Fv w, dz/dt = w - sigma0 |w|/g(w) z; an encoder that
rounds, a drive that holds its torque, a current that is logged with noise. All drives at once.
"""

from __future__ import annotations

import numpy as np

STEPS = 10  # of the drive in a sample
NAMES = ("J", "Fc", "Fs", "Fv", "vs", "sigma0", "sigma1")


def drawn(n, random):
    """n drives, name -> (n,)."""

    def even(low, high):
        return np.exp(random.uniform(np.log(low), np.log(high), n))

    Fc = even(0.1, 0.4)
    return {
        "J": even(1e-3, 4e-3),
        "Fc": Fc,
        "Fs": Fc * random.uniform(1.05, 1.4, n),
        "Fv": even(0.005, 0.03),
        "vs": even(0.02, 0.1),
        "sigma0": Fc / even(5e-4, 3e-3),
        "sigma1": even(0.2, 0.8),
    }


def relaxation(p, w):
    """sigma0 |w|/g(w) in 1/s."""
    level = p["Fc"] + (p["Fs"] - p["Fc"]) * np.exp(-((w / p["vs"]) ** 2))
    return p["sigma0"] * np.abs(w) / level


def moved(p, x, u, dt):
    """theta, w, z after a sample of held torque: implicit midpoints."""
    theta, w, z = x
    h, k = dt / STEPS, p["sigma1"] + p["Fv"]
    for _ in range(STEPS):
        middle = w
        for _ in range(2):
            a = relaxation(p, middle)
            s = (p["sigma0"] - p["sigma1"] * a) / (1.0 + 0.5 * h * a)
            resists = 1.0 + 0.5 * h / p["J"] * (k + 0.5 * h * s)
            middle = (w + 0.5 * h / p["J"] * (u - s * z)) / resists
        bend = (z + 0.5 * h * middle) / (1.0 + 0.5 * h * a)
        theta, w, z = theta + h * middle, 2.0 * middle - w, 2.0 * bend - z
    return theta, w, z


def logged(p, dt, seconds, random, counts, noise):
    """A speed loop that jogs and reverses slowly: t, u with noise (a share of Fc), theta."""
    n, samples, step = len(p["J"]), int(seconds / dt), 2.0 * np.pi / counts
    speed, phase = random.uniform(3.0, 6.0, n), random.uniform(0.0, 2.0 * np.pi, (3, n))
    f = np.array([[0.37], [1.1], [2.9]]) * random.uniform(0.8, 1.2, (3, n))
    size, b = np.array([[1.0], [0.5], [0.2]]), 60.0
    x, last, q = (np.zeros(n),) * 3, np.zeros(n), np.zeros(n)
    u, theta = np.zeros((samples, n)), np.zeros((samples, n))
    for i in range(samples):
        t, seen = dt * i, step * np.round(x[0] / step)
        r = speed * (size * np.sin(2.0 * np.pi * f * t + phase)).sum(axis=0)
        r = r if t % 10.0 <= 8.0 else 0.02 * speed * np.sin(np.pi * t)
        e = (seen - last) / dt - r
        q, last = q + e * dt, seen
        theta[i], u[i] = seen, -p["J"] * (1.4 * b * e + 0.5 * b**2 * q)
        x = moved(p, x, u[i], dt)
    return dt * np.arange(samples), u + noise * p["Fc"] * random.normal(size=u.shape), theta


def missed(p, own, kind, share, speed, dt, counts, f=1.0):
    """RMS error of the drives p that follow a sine from rest, by the motion itself.

    ``own``: gains kp, ki, kd and the values that the friction model in the controller believes, of
    whose torque, along the measured speed, ``share`` is added.
    """
    n, step, turn = len(p["J"]), 2.0 * np.pi / counts, 2.0 * np.pi * f
    first, samples = round(0.25 / f / dt), round(1.25 / f / dt) + 1
    x, z, q = (np.zeros(n),) * 3, np.zeros(n), np.zeros(n)
    last, before, e_before, left = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((samples, n))
    for i in range(samples):
        t, seen = dt * i, step * np.round(x[0] / step)
        v, last = (seen - last) / dt, seen
        w, a = speed * np.sin(turn * t), speed * turn * np.cos(turn * t)
        angle = speed / turn * (1.0 - np.cos(turn * t))
        left[i] = x[1] - w if kind == "velocity" else x[0] - angle
        e = v - w if kind == "velocity" else seen - angle
        if i:  # a sample later, by trapezoids
            middle, q = 0.5 * (v + before), q + 0.5 * dt * (e + e_before)
            rate = np.maximum(relaxation(own, middle), 1e-9)
            z = z * np.exp(-rate * dt) - np.expm1(-rate * dt) / rate * middle
        before, e_before = v, e
        friction = own["sigma0"] * z + own["Fv"] * v
        friction += own["sigma1"] * (v - relaxation(own, v) * z)
        u = own["J"] * a + share * friction - own["kp"] * e - own["ki"] * q
        u = u if kind == "velocity" else u - own["kd"] * (v - w)
        x = moved(p, x, u, dt)
    return np.sqrt(np.mean(left[first:] ** 2, axis=0))
