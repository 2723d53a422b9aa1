"""The work item: ten seconds of the Table 1 velocity loop with the proposed observer at 1 kHz.

The observer believes 10 % less sigma0, Fc and Fs, and z(0) = 2e-4: with exact parameters the
friction cancels and the loop is linear. The reference solution below shares no line with the
library: its equations are written by hand, for Runge-Kutta steps that end where w = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from math import exp, pi
from typing import Any

import numpy as np

import lugrectl as lg

KP, KI, K1, K2 = 1.6, 0.16, -10.24, 22.0
STATES = ("plant_theta", "plant_w", "plant_z", "proposed_observer_zhat", "proposed_observer_what")
STATES += ("pi_q",)
t = np.arange(10_001) * 1e-3
r = np.sin(2 * pi * t)
x0 = np.array([0.0, 0.0, 2e-4, 0.0, 0.0, 0.0])
plant = lg.table1()
believed = replace(plant, sigma0=0.9 * plant.sigma0, Fc=0.9 * plant.Fc, Fs=0.9 * plant.Fs)


def loop(believes: Any = believed) -> Any:
    """The loop, built anew; its states are STATES."""
    made = lg.velocity_loop(
        plant, "proposed", kp=KP, ki=KI, K1=K1, K2=K2, observer_parameters=believes
    )
    assert tuple(made.state_labels) == STATES
    return made


def worst(states: np.ndarray, exact: np.ndarray) -> float:
    """Largest error of any state, relative to the largest value of that state."""
    size = np.max(np.abs(exact), axis=1)
    return float(np.max(np.max(np.abs(states - exact), axis=1) / size))


Rate = Callable[[float, Sequence[float], float], list[float]]


def _rate(reference: Callable[[float], float]) -> Rate:
    """The equations of the loop for the side (+1, -1) on which w is."""
    a, b = plant, believed
    Fv_miss = b.Fv - a.Fv

    def rate(time: float, x: Sequence[float], side: float) -> list[float]:
        _, w, z, zh, wh, q = x
        e = w - reference(time)
        level = a.Fc + (a.Fs - a.Fc) * exp(-((w / a.vs) ** 2))
        guess = b.Fc + (b.Fs - b.Fc) * exp(-((w / b.vs) ** 2))
        dz = w - a.sigma0 * side * w * z / level
        dzh = w - b.sigma0 * side * w * zh / guess + K1 * (w - wh)
        push = -KP * e + KI * q
        miss = b.sigma0 * zh + b.sigma1 * dzh - a.sigma0 * z - a.sigma1 * dz + Fv_miss * w
        return [w, (push + miss) / a.J, dz, dzh, (push + K2 * (w - wh)) / b.J, -e]

    return rate


def _step(f: Rate, time: float, x: Sequence[float], h: float, side: float) -> list[float]:
    k1 = f(time, x, side)
    k2 = f(time + h / 2, [v + h / 2 * k for v, k in zip(x, k1, strict=True)], side)
    k3 = f(time + h / 2, [v + h / 2 * k for v, k in zip(x, k2, strict=True)], side)
    k4 = f(time + h, [v + h * k for v, k in zip(x, k3, strict=True)], side)
    parts = zip(x, k1, k2, k3, k4, strict=True)
    return [v + h / 6 * (a + 2 * b + 2 * c + d) for v, a, b, c, d in parts]


def _to_zero(f: Rate, time: float, x: Sequence[float], h: float, side: float) -> float:
    """The length of the step that ends at w = 0, by bisection."""
    low, high = 0.0, h
    for _ in range(60):
        middle = (low + high) / 2
        inside = _step(f, time, x, middle, side)[1] * side > 0
        low, high = (middle, high) if inside else (low, middle)
    return high


@cache
def exact(parts: int = 16, samples: int = len(t)) -> np.ndarray:
    """States (6, samples): classical Runge-Kutta, ``parts`` steps a sample, w = 0 located."""
    times, values = t.tolist(), r.tolist()
    x, side, kept = x0.tolist(), -1.0, [x0.tolist()]  # F(0) = sigma0 z(0) > 0 drives w below 0
    for k in range(samples - 1):
        slope = (values[k + 1] - values[k]) / 1e-3
        f = _rate(lambda s, k=k, slope=slope: values[k] + slope * (s - times[k]))
        for i in range(parts):
            time, h = times[k] + i * 1e-3 / parts, 1e-3 / parts
            new = _step(f, time, x, h, side)
            if new[1] * side < 0:
                first = _to_zero(f, time, x, h, side)
                x, side = _step(f, time, x, first, side), -side
                new = _step(f, time + first, x, h - first, side)
            x = new
        kept.append(x)
    return np.array(kept).T
