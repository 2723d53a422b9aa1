"""Coulomb friction of a user's own block, with np.sign: starts, stops and rests in closed form."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg

from ..cases.own import moving, user_block
from ..cases.systems import engine_run

pytestmark = pytest.mark.usefixtures("interpreted")

J, FC = 0.3, 0.7


def two_conditions(w: Any) -> Any:
    return np.where(w > 0.0, 1.0, np.where(w < 0.0, -1.0, 0.0))


def drive(side: Callable[[Any], Any] = np.sign) -> ct.NonlinearIOSystem:
    """J dw/dt = u - Fc sign(w), dtheta/dt = w; puts out theta, w and the friction."""
    return user_block(
        lambda t, x, u, p: np.array([x[1], (u[0] - FC * side(x[1])) / J]),
        lambda t, x, u, p: np.array([x[0], x[1], FC * side(x[1])]),
        "u",
        ["angle", "speed", "friction"],
        ["theta", "w"],
        "drive",
    )


@pytest.mark.parametrize("side", [np.sign, two_conditions])
def test_a_ramped_torque_breaks_away_at_Fc(way: str, side: Callable[[Any], Any]) -> None:
    """u = c t: at rest to t0 = Fc/c, then w = c (t - t0)^2 / 2 J; the friction holds u."""
    c, t = 0.5, np.linspace(0.0, 3.0, 32)
    ours = lg.simulate(drive(side), t, c * t)
    t0 = FC / c
    after = np.maximum(t - t0, 0.0)
    theta, w, friction = ours.outputs
    assert np.max(np.abs(w[t <= t0])) < 1e-12 * w[-1]
    np.testing.assert_allclose(theta, c * after**3 / 6 / J, rtol=0, atol=1e-9)
    np.testing.assert_allclose(friction, np.minimum(c * t, FC), rtol=1e-9)
    started = t[-1] - np.sqrt(2.0 * J * w[-1] / c)
    assert started == pytest.approx(t0, rel=1e-6)


def test_coasting_stops_and_stays() -> None:
    """w = w0 - Fc t / J to t = J w0 / Fc, theta = J w0^2 / 2 Fc from there on."""
    t, w0 = np.linspace(0.0, 3.0, 31), 1.5
    theta, w, friction = lg.simulate(drive(), t, 0.0, [0.0, w0]).outputs
    stop = J * w0 / FC
    assert np.all(w[t > stop] == 0.0) and np.all(friction[t > stop] == 0.0)
    np.testing.assert_allclose(w, np.maximum(w0 - FC * t / J, 0.0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(theta[t > stop], J * w0**2 / 2 / FC, rtol=1e-10)


def test_a_held_torque_frees_it_at_once() -> None:
    t = np.linspace(0.0, 2.0, 21)
    u = np.where(t >= 1.0, 1.0, np.where(t >= 0.5, -0.4, 0.3))
    _, w, friction = lg.simulate(drive(), t, u, hold=True).outputs
    np.testing.assert_allclose(w, np.maximum(t - 1.0, 0.0) * (1.0 - FC) / J, atol=1e-12)
    np.testing.assert_allclose(friction, np.minimum(u, FC), rtol=1e-12)


def test_stick_slip_on_a_belt_has_the_period_of_the_closed_form() -> None:
    """m x'' + k x = -F, F up to Fs within ``narrow`` of the belt's speed v, Fk beyond.

    After Fs/k it creeps for tau = sqrt(2 m narrow / (k v)) to x1 = Fs/k + v tau, slips through
    the phase pi + 2 phi of a free oscillation, tan(phi) = v sqrt(m k) / (k x1 - Fk), to the
    mirror image of x1 about Fk/k, and rides from there to Fs/k.
    """
    m, k, v, Fs, Fk, narrow = 1.0, 4.0, 0.2, 1.5, 1.0, 1e-9

    def update(t: Any, x: Any, u: Any, p: Any) -> Any:
        slip = x[1] - v
        level = np.where(np.abs(slip) < narrow, Fs, Fk)
        return np.array([x[1], (-k * x[0] - level * np.sign(slip)) / m])

    belt = moving(update, 2, "belt", 0)
    tau = np.sqrt(2 * m * narrow / k / v)
    x1 = Fs / k + v * tau
    phi = np.arctan2(v * np.sqrt(m * k), k * x1 - Fk)
    riding = (Fs / k - (2 * Fk / k - x1)) / v
    period = tau + (np.pi + 2 * phi) / np.sqrt(k / m) + riding
    t = np.concatenate([[0.0], Fs / k / v + period * np.arange(5)])
    x = lg.simulate(belt, t, x0=[0.0, v], rtol=1e-9).states
    np.testing.assert_allclose(x[0, 1:], Fs / k, rtol=0, atol=1e-6 * v * period)
    np.testing.assert_allclose(x[1, 1:], v, rtol=0, atol=2 * narrow)


@pytest.mark.parametrize("seed", range(4))
def test_two_relays_in_a_random_system_are_the_limit_of_steep_slopes(seed: int) -> None:
    """dx/dt = A x + b1 sign(c1 x) + b2 sign(c2 x) + g u, most of which come to rest."""
    random = np.random.default_rng(seed)
    A = random.normal(size=(3, 3)) - np.eye(3)
    c, g, x0 = random.normal(size=(2, 3)), random.normal(size=3), random.normal(size=3)
    b = -np.abs(random.normal(size=2)) * c.T + 0.2 * random.normal(size=(3, 2))

    def system(side: Callable[[Any], Any]) -> ct.NonlinearIOSystem:
        def update(t: Any, x: Any, u: Any, p: Any) -> Any:
            return A @ x + b @ np.array([side(c[0] @ x), side(c[1] @ x)]) + g * u[0]

        return moving(update, 3, "relays", 1)

    t = np.linspace(0.0, 4.0, 41)
    u = 1.5 * np.sin(2.3 * t) + 0.3
    steep = lg.simulate(system(lambda s: np.tanh(s / 1e-6)), t, u, x0, rtol=1e-7).states
    ours = lg.simulate(system(np.sign), t, u, x0, rtol=1e-7).states
    np.testing.assert_allclose(ours, steep, atol=1e-3 * np.max(np.abs(steep)))


def test_rest_takes_few_steps_and_stays_through_a_loop(way: str) -> None:
    """A PI that winds up against Coulomb friction: long rests, each sample in one step."""
    pi = user_block(
        lambda t, x, u, p: 0.2 - u[0],
        lambda t, x, u, p: 2.0 * x[0] + 0.5 * (0.2 - u[0]),
        "speed",
        "u",
        "q",
        "pi",
    )
    loop = ct.interconnect(
        [drive(), pi], inputs=[], outputs=["speed", "u", "friction"], check_unused=False
    )
    run = engine_run(loop, way, np.linspace(0.0, 20.0, 401), [0.0, -0.5, 0.0], rtol=1e-6)
    assert np.isnan(run.unsettled) and run.steps < 1500
    speed, u, friction = run.y
    rest = np.abs(speed) < 1e-14
    assert rest.sum() > 20
    np.testing.assert_allclose(friction[rest], u[rest], atol=1e-9)
