"""A motion of several sines, with its speed and acceleration."""

import numpy as np


def sines(t, parts):
    """theta, w, a (N,) of the sum of A sin(2 pi f t + phase) over parts (A, f, phase)."""
    theta, w, a = np.zeros((3, len(t)))
    for A, f, phase in parts:
        at, omega = 2 * np.pi * f * t + phase, 2 * np.pi * f
        theta, w = theta + A * np.sin(at), w + A * omega * np.cos(at)
        a = a - A * omega**2 * np.sin(at)
    return theta, w, a
