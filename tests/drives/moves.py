"""References: speed, position and torque per sample, scaled to a machine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .machines import Machine
from .plant import OPEN_LOOP, POSITION_LOOP, SPEED_LOOP

Reference = tuple[int, np.ndarray]  # loop, refs (3, N): speed, position, torque
TURN = 2.0 * np.pi


def smooth(x: np.ndarray, width: int) -> np.ndarray:
    """Running mean: steps become ramps."""
    width = max(1, min(width, len(x) // 4))
    padded = np.concatenate([np.full(width, x[0]), x])
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return ((total[width:] - total[:-width]) / width)[1:]


def _sines(rng, t, bands, top: Callable[[float], float]) -> np.ndarray:
    total = np.zeros_like(t)
    for low, high in bands:
        f = np.exp(rng.uniform(np.log(low), np.log(high)))
        total += top(f) * rng.uniform(0.4, 1.0) * np.sin(TURN * f * t + rng.uniform(-np.pi, np.pi))
    return total


def _levels(m, rng, t):
    x, at = np.zeros_like(t), 0.0
    while at < t[-1]:
        x[t >= at] = m.w_max * rng.choice([-1, 1]) * rng.uniform(0.05, 1.0) ** 1.5
        at += rng.uniform(0.3, 0.9)
    return x


def _waves(m, rng, t):
    def top(f):
        return min(0.45 * m.w_max, 3.0 * m.Fc / (m.J * TURN * f))

    return _sines(rng, t, [(0.3, 0.8), (0.8, 2.0), (2.0, 4.5)], top)


def _cruise(m, rng, t):
    return np.full_like(t, m.w_max * rng.choice([-1, 1]) * rng.uniform(0.5, 1.0))


def _creep(m, rng, t):
    return np.full_like(t, m.w_max * rng.choice([-1, 1]) * np.exp(rng.uniform(-5.0, -2.5)))


def _reversals(m, rng, t):
    saw = 2.0 * np.abs(2.0 * ((t * rng.uniform(0.4, 1.5)) % 1.0) - 1.0) - 1.0
    return m.w_max * rng.uniform(0.1, 0.7) * saw


def _shake(m, rng, t):
    def top(f):
        return min(0.4 * m.w_max, 2.5 * m.Fc / (m.J * TURN * f))

    return _sines(rng, t, [(4.0, 10.0)], top)


def _rest(m, rng, t):
    x = np.zeros_like(t)
    x[t > rng.uniform(0.5, 0.9) * t[-1]] = m.w_max * rng.uniform(-0.3, 0.3)
    return x


def _blocks(m: Machine, rng, t):
    """Blocks of every kind in random order, steered back towards the start."""
    dt, parts, place = t[1] - t[0], [], 0.0
    far = 2.0 * TURN if m.rotary else 0.3
    kinds: list[Callable] = []
    while sum(map(len, parts)) < len(t):
        if not kinds:
            kinds = [_levels, _waves, _creep, _reversals, _shake, _levels, _waves, _cruise, _rest]
            rng.shuffle(kinds)
        block = kinds.pop()(m, rng, np.arange(0.0, rng.uniform(1.5, 3.5), dt))
        drift = float(np.sum(block) * dt)
        if abs(place) > far and drift * place > 0.0:
            block, drift = -block, -drift
        place += drift
        parts.append(block)
    return np.concatenate([[0.0], *parts])[: len(t)]


def _rich(m: Machine, rng, t):
    dt, need = t[1] - t[0], 1.7 * TURN if m.rotary else 0.0
    ramp = np.clip(m.J * m.w_max / (rng.uniform(1.5, 4.0) * m.Fc), 0.03, 0.8)
    speed, travel = np.zeros_like(t), 0.0
    for _ in range(12):
        trial = smooth(_blocks(m, rng, t), int(ramp / dt))
        if np.ptp(np.cumsum(trial) * dt) > travel:
            speed, travel = trial, np.ptp(np.cumsum(trial) * dt)
        if travel > need:
            break
    speed *= float(np.clip(need / travel, 1.0, 1.5))
    return SPEED_LOOP, np.array([speed, np.zeros_like(t), np.zeros_like(t)])


def _sparse(m: Machine, rng, t):
    """One slow sine of speed, nothing else."""
    f = rng.uniform(0.1, 0.5)
    speed = m.w_max * np.exp(rng.uniform(-3.2, -1.6)) * np.sin(TURN * f * t)
    return SPEED_LOOP, np.array([speed, np.zeros_like(t), np.zeros_like(t)])


def _stopgo(m: Machine, rng, t):
    """Slow speeds with stops of very different length."""
    x, at = np.zeros_like(t), 0.0
    while at < t[-1]:
        at += np.exp(rng.uniform(np.log(0.05), np.log(1.5)))
        go = rng.uniform(0.2, 0.7)
        slow = np.exp(rng.uniform(np.log(m.vs), np.log(0.12 * m.w_max)))
        x[(t >= at) & (t < at + go)] = slow * rng.choice([-1, 1])
        at += go
    speed = smooth(x, int(rng.uniform(0.1, 0.3) / (t[1] - t[0])))
    return SPEED_LOOP, np.array([speed, np.zeros_like(t), np.zeros_like(t)])


def _moves(m: Machine, rng, t):
    """Point to point with cosine speed profiles and dwell."""
    speed, at = np.zeros_like(t), rng.uniform(0.1, 0.4)
    place, span = 0.0, (max(1.3 * TURN, 0.6 * m.w_max) if m.rotary else 0.5)
    full = True  # the first move covers most of the span
    while at < t[-1]:
        stretch = span * (0.85 if full else np.exp(rng.uniform(-3.5, 0.0)))
        back = place + stretch > span or (place > stretch and rng.random() < 0.5)
        way = -stretch if back else stretch
        peak, full = m.w_max * rng.uniform(0.8 if full else 0.4, 1.0), False
        time = max(2.0 * abs(way) / peak, np.sqrt(TURN * abs(way) * m.J / (3.0 * m.Fc)), 0.15)
        inside = (t >= at) & (t < at + time)
        speed[inside] = way / time * (1.0 - np.cos(TURN * (t[inside] - at) / time))
        place += way
        at += time + rng.uniform(0.15, 1.0)
    return POSITION_LOOP, _with_position(speed, t, m)


def _with_position(speed, t, m):
    dt = t[1] - t[0]
    place = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * dt])
    return np.array([speed, place, np.zeros_like(t)])


def _multisine(m: Machine, rng, t):
    """Sum of sines in position, the slowest grown to a turn; its speed is fed forward."""

    def top(f):
        return min(0.4 * m.w_max, 2.0 * m.Fc / (m.J * TURN * f))

    start = np.minimum(1.0, t / 0.5)
    bands = [(0.1, 0.3), (0.3, 0.6), (0.6, 1.2), (1.2, 2.5)]
    quick = _sines(rng, t, bands[: rng.integers(2, 5)], top) * start
    slow = _sines(rng, t, [(0.04, 0.1)], top) * start
    refs = _with_position(quick + slow, t, m)
    for _ in range(16):
        if not m.rotary or np.ptp(refs[1]) > 1.3 * TURN:
            break
        slow *= 1.12
        refs = _with_position(quick + slow, t, m)
    return POSITION_LOOP, refs


def _torque(m: Machine, rng, t):
    """Open loop: a multisine, a chirp or both, strong enough to break away."""
    slow = 0.06 if m.rotary else 0.5
    peak = rng.uniform(2.2, 3.5) * m.Fs
    multi = _sines(rng, t, [(slow, 2 * slow), (0.3, 0.8), (0.8, 2.0), (2.0, 6.0)], lambda f: 1.0)
    f0, f1 = 2.5 * slow, rng.uniform(2.0, 8.0)
    rate = np.log(f1 / f0) / t[-1]
    chirp = np.sin(TURN * f0 * np.expm1(rate * t) / rate)
    mix = rng.choice([0.0, 0.5, 1.0])
    wave = mix * multi / np.max(np.abs(multi)) + (1.0 - mix) * chirp
    torque = peak * wave / np.max(np.abs(wave)) * np.minimum(1.0, t / 0.3)
    return OPEN_LOOP, np.array([np.zeros_like(t), np.zeros_like(t), torque])


EXCITATIONS: dict[str, Callable[[Machine, np.random.Generator, np.ndarray], Reference]] = {
    "rich": _rich,
    "sparse": _sparse,
    "stopgo": _stopgo,
    "moves": _moves,
    "multisine": _multisine,
    "torque": _torque,
}
