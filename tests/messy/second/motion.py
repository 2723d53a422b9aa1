"""What the drive is asked to do: references of position, speed, acceleration and torque."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from .machine import Machine

BOUND = ("trapezoid", "sine", "chirp", "multisine", "scan")
SPEED = ("sine", "multisine", "staircase", "chirp")
TORQUE = ("pulses", "torque_sine", "torque_multisine")

OFTEN = {"trapezoid": 3.0, "staircase": 2.0, "sine": 1.5}  # how often beside the others


def _smooth(x: np.ndarray, n: int) -> np.ndarray:
    if n < 2:
        return x
    c = np.cumsum(np.concatenate([np.full(n, x[0]), x]))
    return (c[n:] - c[:-n]) / n


def _move(d: float, v: float, a: float, dt: float) -> np.ndarray:
    """Speed along a trapezoid of length ``d``."""
    v = min(v, np.sqrt(abs(d) * a))
    ramp = v / a
    t = np.arange(0.0, abs(d) / v + ramp, dt)
    return np.sign(d) * np.clip(np.minimum(t, t[-1] - t) * a, 0.0, v)


def trapezoid(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """Moves between random targets with rests between them."""
    parts, x, size = [], 0.0, 0
    while size < n:
        target = rng.uniform(-m.stroke, m.stroke)
        if abs(target - x) < 0.2 * m.stroke:
            continue
        leg = _move(
            target - x, m.wmax * rng.uniform(0.25, 1), m.amax * rng.uniform(0.5, 1), 1 / m.fs
        )
        rest = np.zeros(int(rng.choice([0.0, 0.1, 0.4]) * rng.random() * m.fs))
        x, size = x + leg.sum() / m.fs, size + leg.size + rest.size
        parts += [leg, rest]
    return _smooth(np.concatenate(parts)[:n], int(rng.uniform(0.004, 0.04) * m.fs))


def sine(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """Jogs of several amplitudes and rates, whole periods each."""
    parts, size = [], 0
    while size < n:
        v = m.wmax * rng.uniform(0.15, 1.0)
        low, high = v / (2 * np.pi * m.stroke), m.amax / (2 * np.pi * v)
        f = np.exp(rng.uniform(np.log(low), np.log(max(1.2 * low, min(high, 8 * low)))))
        count = max(1, int(rng.uniform(2, 6) * f))
        t = np.arange(int(count / f * m.fs)) / m.fs
        parts.append(v * np.sin(2 * np.pi * f * t))
        size += t.size
    return np.concatenate(parts)[:n]


def chirp(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """A sweep, up or down, at constant peak speed."""
    v = m.wmax * rng.uniform(0.3, 0.8)
    low, high = v / (2 * np.pi * m.stroke), m.amax / (2 * np.pi * v)
    f = np.geomspace(low, max(high, 3 * low), n)
    f = f if rng.random() < 0.7 else f[::-1]
    return v * np.sin(2 * np.pi * np.cumsum(f) / m.fs)


def multisine(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """A dozen sines with random phases, within speed, acceleration and stroke."""
    t = np.arange(n) / m.fs
    high = min(m.amax / m.wmax * 0.5, 12.0)
    f = np.exp(rng.uniform(np.log(0.08), np.log(max(high, 0.4)), int(rng.integers(5, 15))))
    w = sum(np.cos(2 * np.pi * x * t + rng.uniform(0, 6.28)) * x**-0.3 for x in f)
    w = w * np.minimum(1.0, t / 0.3)
    x = np.cumsum(w - w.mean()) / m.fs
    a = np.gradient(w) * m.fs
    scale = min(m.wmax / np.abs(w).max(), m.amax / np.abs(a[int(0.4 * m.fs) :]).max())
    return min(scale, 3.0 * m.stroke / np.ptp(x)) * (w - w.mean())


def staircase(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """Constant speeds, both ways or one, with ramps."""
    w, now, k = np.zeros(n), 0.0, 0
    one_way = rng.random() < 0.15
    while k < n:
        goal = m.wmax * rng.choice([0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0])
        goal *= 1.0 if one_way else rng.choice([-1, 1])
        ramp = max(2, int(abs(goal - now) / m.amax * rng.uniform(1.2, 3) * m.fs))
        leg = np.concatenate(
            [np.linspace(now, goal, ramp), np.full(int(rng.uniform(0.4, 1.8) * m.fs), goal)]
        )
        w[k : k + leg.size] = leg[: n - k]
        now, k = goal, k + leg.size
    return _smooth(w, int(0.01 * m.fs))


def scan(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """Slow travel to and fro, a few speeds."""
    parts, size, side = [], 0, 1.0
    reach = m.stroke * rng.uniform(0.1, 0.6)
    while size < n:
        v = max(m.wmax * log_choice(rng, 0.02, 0.3), reach / 6.0)
        leg = _move(side * reach, min(v, m.wmax), m.amax * rng.uniform(0.2, 0.8), 1 / m.fs)
        parts.append(leg)
        side, size = -side, size + leg.size
    return _smooth(np.concatenate(parts)[:n], int(0.01 * m.fs))


def log_choice(rng: Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def pulses(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """Torque pulses and steps of both signs with coasting between them."""
    u, k, side = np.zeros(n), int(0.1 * m.fs), 1.0
    fs, j = m.P["Fs"], m.P["J"]
    while k < n:
        level = fs * rng.uniform(1.15, 1.3 + j * m.amax / fs)
        hold = min(rng.uniform(0.4, 1.0) * m.wmax * j / (level - 0.9 * m.P["Fc"]), 1.5)
        hold = max(hold, 0.03)
        stop = k + int(hold * m.fs) + 1
        u[k:stop] = side * level
        k = stop + int(rng.choice([0.05, 0.4, 0.8]) * rng.uniform(0.5, 1.0) * m.fs)
        side = -side if rng.random() < 0.8 else side
    return u


def torque_sine(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """Torque sines with slow change of the amplitude."""
    t = np.arange(n) / m.fs
    f = np.clip(m.amax / m.wmax / 2 / np.pi * rng.uniform(0.5, 1.5), 0.15, 8)
    swell = 1.0 + 0.35 * np.sin(2 * np.pi * t / rng.uniform(5, 12))
    return (m.P["Fs"] * 1.1 + m.P["J"] * m.amax * 0.5) * swell * np.sin(2 * np.pi * f * t)


def torque_multisine(rng: Generator, m: Machine, n: int) -> np.ndarray:
    """A random multisine of torque."""
    t = np.arange(n) / m.fs
    f = np.exp(rng.uniform(np.log(0.15), np.log(6.0), 9))
    u = sum(np.sin(2 * np.pi * x * t + rng.uniform(0, 6.28)) for x in f) / 2.1
    return (m.P["Fs"] * 1.2 + 0.6 * m.P["J"] * m.amax) * u


def reference(rng: Generator, m: Machine, name: str, seconds: float) -> np.ndarray:
    """References (4, n): position, speed, acceleration, torque."""
    n = int(seconds * m.fs)
    x = globals()[name](rng, m, n)
    ref = np.zeros((4, n))
    if name in TORQUE:
        ref[3] = x
        return ref
    ref[1] = x
    ref[0] = np.cumsum(x) / m.fs
    ref[2] = np.gradient(x) * m.fs
    return ref
