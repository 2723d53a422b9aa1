"""Reference motions at the control rate: position, velocity and acceleration."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from .machine import Machine
from .plant import RATE

KINDS = ("moves", "jogs", "sweep", "multisine", "chirp", "mixed")


def reference(m: Machine, g: np.random.Generator, kind: str, duration: float, quick: float = 1.0):
    """``(theta, w, a)`` of one excitation; ``quick`` > 1 asks for sharper changes."""
    n = int(duration * RATE)
    if kind == "mixed":
        first = str(g.choice(["moves", "jogs"]))
        v = np.concatenate([_velocity(m, g, first, n // 2), _velocity(m, g, "sweep", n - n // 2)])
    else:
        v = _velocity(m, g, kind, n)
    width = max(int(g.uniform(0.02, 0.08) / quick * RATE), 8)
    v = uniform_filter1d(uniform_filter1d(v, width), width)
    v *= np.minimum(np.arange(n) / (0.3 * RATE), 1)  # from rest
    return np.cumsum(v) / RATE, v, np.gradient(v) * RATE


def _velocity(m: Machine, g: np.random.Generator, kind: str, n: int) -> np.ndarray:
    return {
        "moves": _moves,
        "jogs": _jogs,
        "sweep": _sweep,
        "multisine": _multisine,
        "chirp": _chirp,
    }[kind](m, g, n)


def _moves(m: Machine, g: np.random.Generator, n: int) -> np.ndarray:
    """Point to point between random places, trapezoids of velocity with dwells."""
    reach = m.top**2 / m.pull * g.uniform(1.2, 4.0)
    place, pieces, total = 0.0, [np.zeros(int(0.1 * RATE))], 0
    while total < n:
        target = g.uniform(-reach, reach)
        if abs(target - place) < 0.1 * reach:
            continue
        pieces += [
            _trapezoid(target - place, m.top * g.uniform(0.3, 1), m.pull * g.uniform(0.5, 1))
        ]
        pieces += [np.zeros(int(g.uniform(0.02, 0.3) * RATE))]
        place, total = target, sum(len(p) for p in pieces)
    return np.concatenate(pieces)[:n]


def _trapezoid(way: float, speed: float, pull: float) -> np.ndarray:
    speed = min(speed, np.sqrt(abs(way) * pull))
    ramp = speed / pull
    t = np.arange(0, abs(way) / speed + ramp, 1 / RATE)
    up = np.minimum(t * pull, speed)
    return np.sign(way) * np.maximum(np.minimum(up, (t[-1] - t) * pull), 0)


def _jogs(m: Machine, g: np.random.Generator, n: int) -> np.ndarray:
    """Constant speeds of either sign with ramps, from crawling to fast."""
    pieces, speed, total, sign = [], 0.0, 0, 1
    while total < n:
        sign = -sign if g.random() < 0.7 else sign
        target = 0.0 if g.random() < 0.1 else sign * m.top * g.uniform(0.15, 1) ** g.uniform(1, 2.5)
        ramp = max(int(abs(target - speed) / (m.pull * g.uniform(0.4, 1)) * RATE), 8)
        pieces += [
            np.linspace(speed, target, ramp),
            np.full(int(g.uniform(0.2, 1.0) * RATE), target),
        ]
        speed, total = target, sum(len(p) for p in pieces)
    return np.concatenate(pieces)[:n]


def _sweep(m: Machine, g: np.random.Generator, n: int) -> np.ndarray:
    """Slow ramps of velocity through zero and back, growing from pass to pass."""
    period = g.uniform(0.9, 3.5)
    t = np.arange(n) / RATE
    grow = 0.15 + 0.85 * t / t[-1]
    phase = t / period % 1
    return m.top * grow * (1 - 4 * np.abs(phase - 0.5))


def _multisine(m: Machine, g: np.random.Generator, n: int) -> np.ndarray:
    """Four to eight sines between 0.2 and 4 Hz at random phases."""
    t = np.arange(n) / RATE
    number = int(g.integers(4, 9))
    hertz = np.exp(g.uniform(np.log(0.2), np.log(4.0), number))
    gain = hertz ** -g.uniform(0.3, 0.8)
    v = sum(
        a * np.sin(2 * np.pi * f * t + p)
        for a, f, p in zip(gain, hertz, g.uniform(0, 6.28, number), strict=True)
    )
    return v * m.top / np.max(np.abs(v))


def _chirp(m: Machine, g: np.random.Generator, n: int) -> np.ndarray:
    """A sine whose frequency grows to a few hertz and whose amplitude stays within the torque."""
    t = np.arange(n) / RATE
    low, high = g.uniform(0.15, 0.5), g.uniform(2.0, 6.0)
    rate = np.log(high / low) / t[-1]
    hertz = low * np.exp(rate * t)
    phase = 2 * np.pi * low * (np.exp(rate * t) - 1) / rate
    return np.minimum(m.top, 1.3 * m.pull / (2 * np.pi * hertz)) * np.sin(phase)
