"""A textbook system of another field through simulate(), as users write it.

Speed control of a car, Astrom and Murray, Feedback Systems, chapters 3 to 5. Reference:
python-control's own simulation at tight tolerance.
"""

from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

from lugrectl.simulation.response import simulate

from ..cases.own import moving, user_block

pytestmark = pytest.mark.usefixtures("interpreted")

TIGHT = {"rtol": 1e-10, "atol": 1e-12}
RATIOS = [40.0, 25.0, 16.0, 12.0, 10.0]  # wheel to engine speed, 1/m


def agrees(system, t, u, x0, *, rtol=1e-9, within=1e-7, **options) -> None:
    """States and outputs, relative to the largest value of each."""
    ours = simulate(system, t, u, x0, rtol=rtol, squeeze=False, **options)
    theirs = ct.input_output_response(
        system,
        t,
        u,
        x0,
        solve_ivp_method="DOP853",
        solve_ivp_kwargs=TIGHT,
        squeeze=False,
        **options,
    )
    for a, b in ((ours.states, theirs.states), (ours.outputs, theirs.outputs)):
        scale = np.abs(b).max(axis=1, keepdims=True) + 1e-12
        assert np.max(np.abs(np.asarray(a) - np.asarray(b)) / scale) < within


# Speed control: m dv/dt = n u T(n v) - m g sin(slope) - m g Cr sign(v) - rho Cd A |v| v / 2.


def torque(omega, params):
    """T = Tm (1 - beta (omega/omega_m - 1)^2), never negative."""
    Tm, peak = params.get("Tm", 190.0), params.get("omega_m", 420.0)
    return np.clip(Tm * (1 - params.get("beta", 0.4) * (omega / peak - 1) ** 2), 0, None)


def car_rate(t, x, u, params):
    m, g, n = params.get("m", 1600.0), 9.8, RATIOS[int(params.get("gear", 4)) - 1]
    v, throttle, slope = x[0], np.clip(u[0], 0, 1), u[1]
    push = n * throttle * torque(n * v, params)
    drag = 0.5 * 1.3 * 0.32 * 2.4 * abs(v) * v
    return [(push - m * g * np.sin(slope) - m * g * 0.01 * np.sign(v) - drag) / m]


def car(rate=car_rate, **options):
    return moving(rate, ["v"], "car", ["throttle", "slope"], **options)


def cruise(body):
    """PI control of the speed; the throttle is what the clip in the car leaves of it."""
    control = user_block(
        lambda t, x, u, params: u[0] - u[1],
        lambda t, x, u, params: params["kp"] * (u[0] - u[1]) + params["ki"] * x[0],
        ["v_ref", "v"],
        ["throttle"],
        ["sum"],
        "control",
        kp=0.5,
        ki=0.1,
    )
    return ct.interconnect(
        [control, body],
        inputs=["v_ref", "slope"],
        outputs=["v", "throttle"],
        params={},
        name="loop",
    )


T = np.linspace(0, 20, 81)
HILL = np.where(T <= 5, 0.0, np.where(T >= 6, 4.0, 4.0 * (T - 5))) * np.pi / 180


def test_a_car_uphill_under_control():
    agrees(cruise(car()), T, [20 + 2 * (T > 10), HILL], [0.0, 20.0])


def test_gear_and_mass_are_parameters():
    """The gear is an index, so each gear is traced on its own; the mass is only a number."""
    body, u = car(params={"m": 1600.0, "gear": 4}), [0.6 + 0 * T, HILL]
    speeds = []
    for params in ({"m": 1600.0}, {"m": 2000.0}, {"m": 1600.0, "gear": 5}):
        agrees(body, T, u, [20.0], params=params)
        speeds.append(float(simulate(body, T, u, [20.0], params=params).outputs[0, -1]))
    assert len({round(v, 3) for v in speeds}) == 3


def by_branch(t, x, u, params):
    if u[0] < 0:
        return [-x[0]]
    return car_rate(t, x, u, params)


def by_max(t, x, u, params):
    return car_rate(t, x, [max(0.0, min(u[0], 1.0)), u[1]], params)


def by_sine(t, x, u, params):
    return [car_rate(t, x, [u[0], 0.0], params)[0] - 9.8 * math.sin(u[1])]


def by_gear_signal(t, x, u, params):
    gear = int(3.5 + 0.4 * np.tanh(u[0]))
    return car_rate(t, x, u, {**params, "gear": gear})


@pytest.mark.parametrize("rate", [by_branch, by_max, by_sine, by_gear_signal])
def test_what_cannot_be_followed_is_said_and_still_right(rate):
    """One warning, with block and line; the answer is that of python-control."""
    line = rate.__code__.co_firstlineno
    loop, t = cruise(car(rate)), np.linspace(0, 3, 13)
    u, x0 = [20 + 0 * t, 0.05 * np.sin(t)], [8.0, 19.5]
    with pytest.warns(RuntimeWarning) as said:
        ours = simulate(loop, t, u, x0, rtol=1e-9)
    assert len(said) == 1
    place = str(said[0].message)
    assert "block car" in place and "test_textbook_systems.py" in place and "LSODA" in place
    assert line < int(place.split("line ")[1].split(":")[0]) <= line + 3
    theirs = ct.input_output_response(
        loop, t, u, x0, solve_ivp_method="DOP853", solve_ivp_kwargs=TIGHT
    )
    np.testing.assert_allclose(ours.outputs, theirs.outputs, rtol=1e-6, atol=1e-8)
