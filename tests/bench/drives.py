"""Drives drawn at random, their logs, and how well a controller of our own follows with them.

Nothing here is of the package. An encoder rounds, the drive holds its torque, the current is
logged with noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..drives.machines import MACHINES, Machine
from ..drives.run import Program, programmed

NAMES = ("J", "Fc", "Fs", "Fv", "vs", "sigma0", "sigma1")


def drawn(n, random) -> list[Machine]:
    """n drives."""

    def even(low, high):
        return np.exp(random.uniform(np.log(low), np.log(high), n))

    Fc = even(0.1, 0.4)
    columns = {
        "J": even(1e-3, 4e-3),
        "Fc": Fc,
        "Fs": Fc * random.uniform(1.05, 1.4, n),
        "Fv": even(0.005, 0.03),
        "vs": even(0.02, 0.1),
        "sigma0": Fc / even(5e-4, 3e-3),
        "sigma1": even(0.2, 0.8),
    }
    rows = ({k: float(v[i]) for k, v in columns.items()} for i in range(n))
    return [replace(MACHINES["servo"], **row) for row in rows]


def logged(machines, dt, seconds, random, counts, noise):
    """A speed loop that jogs and reverses slowly: t, u with noise (a share of Fc), theta."""
    n, t, step = len(machines), dt * np.arange(int(seconds / dt)), 2.0 * np.pi / counts
    speed, phase = random.uniform(3.0, 6.0, n), random.uniform(0.0, 2.0 * np.pi, (3, n))
    f = np.array([[0.37], [1.1], [2.9]]) * random.uniform(0.8, 1.2, (3, n))
    made = []
    for m, top, one, angle in zip(machines, speed, f.T, phase.T, strict=True):
        waves = np.array([1.0, 0.5, 0.2]) @ np.sin(2.0 * np.pi * np.outer(one, t) + angle[:, None])
        slow = 0.02 * top * np.sin(np.pi * t)
        made.append(
            programmed(m, jogs(m, np.where(t % 10.0 <= 8.0, top * waves, slow), dt, step), dt)
        )
    u, theta, _ = np.array(made).transpose(1, 2, 0)
    Fc = np.array([m.Fc for m in machines])
    return t, u + noise * Fc * random.normal(size=u.shape), step * np.round(theta / step)


def jogs(m: Machine, speed, dt: float, step: float) -> Program:
    """A PI loop on the difference of counts."""
    theta, last, q, b = 0.0, 0.0, 0.0, 60.0
    for r in speed:
        seen = step * np.round(theta / step)
        e = (seen - last) / dt - r
        q, last = q + e * dt, seen
        theta, _ = yield float(-m.J * (1.4 * b * e + 0.5 * b**2 * q))


def missed(m: Machine, own, kind, share, speed, dt, counts, f=1.0):
    """RMS error of a drive that follows a sine from rest, by the motion itself.

    ``own``: gains kp, ki, kd and the values that the friction model in the controller believes, of
    whose torque, along the measured speed, ``share`` is added.
    """
    turn, first = 2.0 * np.pi * f, round(0.25 / f / dt)
    t = dt * np.arange(round(1.25 / f / dt) + 1)
    w, angle = speed * np.sin(turn * t), speed / turn * (1.0 - np.cos(turn * t))
    references = w, speed * turn * np.cos(turn * t), angle
    follower = followed(own, kind, share, references, dt, 2.0 * np.pi / counts)
    _, theta, speeds = programmed(m, follower, dt)
    left = speeds - w if kind == "velocity" else theta - angle
    return np.sqrt(np.mean(left[first:] ** 2))


def followed(own, kind, share, references, dt: float, step: float) -> Program:
    """A PI or PID controller, and a friction model that a sample later knows the speed."""
    theta = z = q = last = before = e_before = 0.0
    for i, (w, a, angle) in enumerate(zip(*references, strict=True)):
        seen = step * np.round(theta / step)
        v, last = (seen - last) / dt, seen
        e = v - w if kind == "velocity" else seen - angle
        if i:  # by trapezoids
            middle, q = 0.5 * (v + before), q + 0.5 * dt * (e + e_before)
            rate = max(relaxation(own, middle), 1e-9)
            z = z * np.exp(-rate * dt) - np.expm1(-rate * dt) / rate * middle
        before, e_before = v, e
        friction = own["sigma0"] * z + own["Fv"] * v
        friction += own["sigma1"] * (v - relaxation(own, v) * z)
        u = own["J"] * a + share * friction - own["kp"] * e - own["ki"] * q
        theta, _ = yield float(u if kind == "velocity" else u - own["kd"] * (v - w))


def relaxation(p, w):
    """sigma0 |w|/g(w) in 1/s."""
    level = p["Fc"] + (p["Fs"] - p["Fc"]) * np.exp(-((w / p["vs"]) ** 2))
    return p["sigma0"] * abs(w) / level
