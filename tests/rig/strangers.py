"""Effects outside the catalogue."""

from __future__ import annotations

import numpy as np

from .hiding import ALL, TURN, Size, effect, moment


@effect("torque_bumps", "", "theta", text="narrow torque bumps at fixed positions")
def _bumps(c, rng):
    low, span = float(c.theta.min()), float(np.ptp(c.theta))
    count = int(rng.integers(2, 6))
    period = TURN if c.machine.rotary else 0.0
    width = (0.04 if c.machine.rotary else 0.012 * span) * float(rng.uniform(0.7, 2.0))
    centres = rng.uniform(-np.pi, np.pi, count) if period else low + span * rng.random(count)
    shapes = rng.uniform(0.5, 1.0, count) * rng.choice([-1.0, 1.0], count)
    tail = (width, period, float(count), *map(float, centres), *map(float, shapes))
    return Size(lambda x: (x, *tail), 2.0 * c.aim, power=1.0)


@effect("torque_droop", "", "u", text="torque constant that droops with torque")
def _droop(c, rng):
    high = 0.4 / float(np.max(np.abs(c.u)))
    return Size(lambda x: (x,), min(high, c.scaled(c.u**2)), high=high)


@effect("decaying_burst", "", "t", text="a ringing burst that dies out", excitations=ALL)
def _burst(c, rng):
    t0, tau = moment(c, rng), float(rng.uniform(0.5, 2.0))
    f = float(rng.uniform(2.0, 12.0))
    shape = np.exp(-np.maximum(0, c.t - t0) / tau) * (c.t > t0) / np.sqrt(2.0)
    return Size(lambda x: (x, t0, tau, f), c.scaled(shape))


@effect("contact_pulses", "", "t", text="external contacts at random times", excitations=ALL)
def _pulses(c, rng):
    count, length = int(rng.integers(3, 10)), float(rng.uniform(0.08, 0.4))
    times = np.sort(rng.uniform(0.05, 0.95, count)) * c.t[-1]
    shapes = rng.uniform(0.5, 1.0, count) * rng.choice([-1.0, 1.0], count)
    tail = (length, float(count), *map(float, times), *map(float, shapes))
    share = np.sqrt(0.5 * length * count * 0.58 / c.t[-1])
    return Size(lambda x: (x, *tail), c.aim / share)


@effect("speed_hump", "", "w", text="drag that peaks at one speed, as churning or a resonance does")
def _hump(c, rng):
    speed = np.abs(c.w)
    moving = speed[speed > 0.1 * speed.max()]
    middle = float(np.quantile(moving, rng.uniform(0.35, 0.7)))
    width = middle * float(rng.uniform(0.15, 0.35))
    shape = np.exp(-(((speed - middle) / width) ** 2))
    return Size(lambda x: (x, middle, width), c.scaled(shape))


@effect("dragged_cable", "", "theta w", text="a cable that drags behind (Maxwell-slip sliders)")
def _cable(c, rng):
    presliding, travel = c.machine.Fs / c.machine.sigma0, float(np.ptp(c.theta))
    longest = max(30.0 * presliding, float(rng.uniform(0.03, 0.12)) * travel)
    return Size(lambda x: (x, longest), 1.2 * c.aim)
