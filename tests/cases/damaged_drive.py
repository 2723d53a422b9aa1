"""A small drive under a speed controller, for damaged logs; it shares nothing with the package."""

import functools
import math

import numpy as np

from lugrectl.record import read_log, stretches


@functools.cache
def sound(seed=1, n=6000, rate=500.0, counts=8192, size=6.0):
    """t, u, w, theta of a mass with friction that starts, stops and reverses; read-only.

    PI control of the speed from the encoder's steps, J = 0.0022, Fc = 0.22, Fv = 0.012.
    """
    rng = np.random.default_rng(seed)
    t, h, step = np.arange(n) / rate, 1.0 / rate / 10, 2 * math.pi / counts
    want = sum(
        0.3 * size * rng.uniform(0.5, 1) * np.sin(2 * np.pi * (f * t + rng.uniform()))
        for f in (0.23, 0.61, 1.37)
    )
    k = 0
    while k < n:
        hold = int(rng.uniform(0.3, 0.9) * rate)
        want[k : k + hold] += rng.choice([0.0, 1.0, -1.0, 0.5]) * size * rng.uniform(0.3, 1.0)
        k += hold
    u, w, theta = np.zeros(n), np.zeros(n), np.zeros(n)
    speed = angle = slow = total = last = 0.0
    for i in range(n):
        now = math.floor(angle / step) * step
        slow += 0.3 * ((now - last) * rate - slow)
        last = now
        error = want[i] - slow
        total = min(max(total + 1.2 * error / rate, -1.0), 1.0)
        u[i] = min(max(0.08 * error + total, -1.2), 1.2)
        w[i], theta[i] = speed, now
        for _ in range(10):
            speed += h / 0.0022 * (u[i] - 0.22 * math.tanh(speed / 0.02) - 0.012 * speed)
            angle += h * speed
    w += 0.01 * rng.standard_normal(n)
    made = {"t": t, "u": np.round(u, 5), "w": np.round(w, 5), "theta": theta}
    for x in made.values():
        x.flags.writeable = False
    return made


def columns(*roles, **options):
    """Copies of these channels and t."""
    return {role: sound(**options)[role].copy() for role in ("t", *roles)}


def seen(log, **options):
    """Stretches and sentences of a log given as columns."""
    return stretches([read_log(log, **options)])


def marked(found, t):
    """The rows of stamps t that the stretches call not ok, or that they do not cover."""
    good = np.zeros(len(t), bool)
    for s in found:
        at = np.searchsorted(s.t, t - 1e-6).clip(0, len(s.t) - 1)
        good |= (np.abs(s.t[at] - t) < 1e-6) & s.ok[at]
    return np.flatnonzero(~good)
