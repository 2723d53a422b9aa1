"""Small systems and functions that the tests of sweeps send to other processes."""

from __future__ import annotations

import control as ct
import numpy as np

T = np.linspace(0.0, 1.0, 41)


def lag() -> ct.NonlinearIOSystem:
    """tau dx/dt = gain u - x, of closures, which do not pickle."""
    return ct.nlsys(
        lambda t, x, u, p: (p["lag.gain"] * u[0] - x[0]) / p["lag.tau"],
        lambda t, x, u, p: [x[0], 2.0 * x[0]],
        inputs="u",
        outputs=["y", "double"],
        states="x",
        params={"lag.tau": 0.2, "lag.gain": 1.0},
        name="lag",
    )


def step_response(gain, tau):
    """(L, N) of the lag after a unit step."""
    return np.asarray(gain)[:, None] * (1 - np.exp(-T / np.asarray(tau)[:, None]))


def growth() -> ct.NonlinearIOSystem:
    """dx/dt = g x^2: leaves every bound at t = 1/(g x0)."""
    return ct.nlsys(
        lambda t, x, u, p: p["g"] * x[0] ** 2,
        None,
        inputs=0,
        outputs=1,
        states=["x"],
        params={"g": 1.0},
        name="growth",
    )


def noise(rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal(len(T))


def ramp(member: int) -> np.ndarray:
    if member == 3:
        raise LookupError("no file for three")
    return member * T


def last(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    return y[:, -1]
