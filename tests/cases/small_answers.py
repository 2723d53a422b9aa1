"""Small logs of every kind, and what the package answers to them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import lugrectl as lg

J, FC, FV = 0.002, 0.12, 0.02
SPEEDS, RATES = np.array([6.0, 3.0, 1.2, 0.5]), 2.0 * np.pi * np.array([0.31, 0.83, 1.7, 3.1])
DRIVE = lg.Model.of(J=J, friction="coulomb", Fc=FC, Fv=FV)
STEP = 2.0 * np.pi / 65536.0


def log(
    seconds: float = 8.0,
    dt: float = 5e-3,
    seed: int = 1,
    mean: float = 0.0,
    size: float = 1.0,
    load: Callable[..., Any] | None = None,
    speed: bool = False,
) -> dict[str, np.ndarray]:
    """t, u and theta of a drive with Coulomb friction, which moves as sines around a mean speed.

    The torque is that in the middle of the sample over which it is held.
    """
    random = np.random.default_rng(seed)
    phase, t = random.uniform(0.0, 2.0 * np.pi, 4), dt * np.arange(round(seconds / dt))
    theta, w, _ = _motion(t, phase, mean, size)
    at, v, a = _motion(t + dt / 2, phase, mean, size)
    u = J * a + FC * np.sign(v) + FV * v + 2e-3 * random.standard_normal(len(t))
    u = u if load is None else u + load(at, v)
    more = {"w": w + 1e-3 * random.standard_normal(len(t))} if speed else {}
    return {"t": t, "u": u, "theta": STEP * np.round(theta / STEP), **more}


def _motion(t: np.ndarray, phase: np.ndarray, mean: float, size: float) -> tuple[np.ndarray, ...]:
    angle = RATES * t[:, None] + phase
    theta = mean * t - size * (SPEEDS / RATES * (np.cos(angle) - np.cos(phase))).sum(1)
    w = mean + size * (SPEEDS * np.sin(angle)).sum(1)
    return theta, w, size * (SPEEDS * RATES * np.cos(angle)).sum(1)


def ripple(theta, w):
    return 0.08 * np.sin(7.0 * theta + 0.4)


def weight_and_drag(theta, w):
    """Two effects, of which the drag is one's own."""
    return 0.2 * np.sin(theta + 0.4) + 4e-4 * w**3


def bumps(theta, w):
    """A torque at three places, which nothing in the catalogue explains."""
    places = ((-3.0, 0.25), (0.5, -0.3), (2.5, 0.2))
    return sum(h * np.exp(-(((theta - at) / 0.4) ** 2)) for at, h in places)


def steady() -> list[dict[str, np.ndarray]]:
    """Ten runs at steady speeds of a drive with a drag."""
    random, speeds = (
        np.random.default_rng(0),
        [-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0],
    )
    noise, t = 2e-3 * random.standard_normal((len(speeds), 200)), 5e-3 * np.arange(200)
    return [
        {"t": t, "w": w + 0.5 * e, "u": FC * np.sign(w) + FV * w + 4e-3 * w * abs(w) + e}
        for w, e in zip(speeds, noise, strict=True)
    ]


def in_ms() -> dict[str, np.ndarray]:
    """A log whose time has another unit, which is not said."""
    made = log()
    return made | {"t": 1e3 * made["t"]}


def own_effect() -> Any:
    """Declare an effect of one's own."""

    @lg.block("effect", out="d", acts="torque")
    def cubic_drag(w, c=lg.P(0, "N m s3/rad3", 0, neutral=0)):
        """r_e = c w^3."""
        return c * w**3

    return cubic_drag


FREE = lg.Model.of(friction="coulomb")
DIAGNOSES: dict[str, Callable[[], Any]] = {
    "adequate": lambda: lg.diagnose([log(4.0), log(4.0, seed=2, speed=True)], DRIVE),
    "found": lambda: lg.diagnose(log(load=weight_and_drag), FREE),
    # in one direction a friction that depends on the angle is the same torque as a ripple
    "ambiguous": lambda: lg.diagnose(
        log(mean=6.0, size=0.1, load=lambda theta, w: 0.02 * np.sin(5.0 * theta + 0.4)), DRIVE
    ),
    "unexplained": lambda: lg.diagnose(log(16.0, seed=2, load=bumps), DRIVE),
    "refused": lambda: lg.diagnose(in_ms(), FREE),
    "map": lambda: lg.diagnose(steady(), DRIVE),
    "one way": lambda: lg.diagnose(log(6.0, mean=14.0), FREE),
    "dead": lambda: lg.diagnose(log() | {"u": np.zeros(1600)}, DRIVE),
}
IDENTIFICATIONS = {
    "identified": lambda: lg.identify(log(), FREE),
    "identified map": lambda: lg.identify(steady(), FREE),
}


@cache
def answer(name: str) -> Any:
    """The answer of that name, computed once."""
    return (DIAGNOSES | IDENTIFICATIONS)[name]()
