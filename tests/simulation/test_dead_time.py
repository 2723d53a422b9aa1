"""A dead time is exact in ``simulate``: nothing moves before it is over."""

from __future__ import annotations

from math import exp, factorial

import control as ct
import numpy as np
import pytest

import lugrectl as lg

from ..cases.own import row, static

LATE = 0.15  # s


def integrator(inputs="v", outputs="x"):
    return ct.ss([[0]], [[1]], [[1]], [[0]], inputs=inputs, outputs=outputs, name="integrator")


def steps(t, gain):
    """dx/dt = -gain x(t - LATE), x = 1 until 0: one power more in each interval."""
    n = int(t / LATE) + 2
    late = [t - (k - 1) * LATE for k in range(1, n)]
    terms = ((-gain) ** k * s**k / factorial(k) for k, s in enumerate(late, 1) if s > 0)
    return 1.0 + sum(terms)


@pytest.mark.parametrize("points", [7, 61, 400])
@pytest.mark.parametrize("nested", [False, True])
def test_a_delayed_feedback_is_that_of_the_method_of_steps(points, nested):
    blocks = [
        integrator(),
        static(lambda t, x, u, p: -2.0 * u[0], "late", "v", "static"),
        lg.dead_time(LATE, inputs=["x"], outputs=["late"]),
    ]
    if nested:
        blocks = ct.interconnect(blocks, inputs=[], outputs=["x", "late"], params={}, name="loop")
    t = np.linspace(0.0, 3.0, points)
    found = lg.simulate(blocks, t, None, [1.0, 1.0, 0.0])
    right = np.array([steps(s, 2.0) for s in t])
    assert np.abs(row(found, "x") - right).max() < 1e-8
    before = np.where(t < LATE, 1.0, np.interp(t - LATE, t, right))
    assert np.abs(row(found, "late") - before)[t < LATE].max() == 0.0


def test_a_relay_behind_a_dead_time_swings_by_it():
    """dx/dt = -sign x(t - T): a triangle of amplitude T and period 4 T, late jumps located."""
    blocks = [
        integrator(),
        static(lambda t, x, u, p: -np.sign(u[0]), "x", "jumps", "static"),
        lg.dead_time(LATE, inputs=["jumps"], outputs=["v"]),
    ]
    t = np.linspace(0.0, 2.0, 41)
    found = row(lg.simulate(blocks, t, None, [0.3, -1.0, 0.0]), "x")
    phase = np.mod(t - 0.3, 4 * LATE)
    swing = np.where(phase < LATE, -phase, np.where(phase < 3 * LATE, phase - 2 * LATE, 0.0))
    swing = np.where(phase >= 3 * LATE, 4 * LATE - phase, swing)
    right = np.where(t < 0.3, 0.3 - t, swing)
    assert np.abs(found - right).max() < 1e-5


@pytest.mark.parametrize("hold", [True, False])
def test_a_drive_waits_for_its_torque(hold):
    """J dw/dt = u(t - T) - Fv w with the effect inside the plant."""
    J, Fv, late, dt = 0.004, 0.006, 0.0125, 1e-3
    model = lg.Model.of(friction="viscous", J=J, Fv=Fv).with_effect("input_delay", {"delay": late})
    t = dt * np.arange(200)
    u = 0.1 * np.sign(np.sin(20 * np.pi * t + 0.1))
    found = lg.simulate(lg.plant(model), t, [u, 0.0 * u], hold=hold)
    w = row(found, "w")
    assert np.all(w[t < late] == 0.0)
    fine, v, right = 20, 0.0, np.zeros(len(t))
    decay = exp(-dt / fine * Fv / J)
    for k in range(len(t) * fine - fine):
        middle = (k + 0.5) * dt / fine - late
        if hold:
            torque = u[int(middle / dt + 1e-9)] if middle > 0 else 0.0
        else:
            torque = np.interp(middle, t, u) if middle > 0 else 0.0
        v = decay * v + (1 - decay) / Fv * torque
        if (k + 1) % fine == 0:
            right[(k + 1) // fine] = v
    assert np.abs(w - right).max() < (1e-9 if hold else 1e-4)


def test_beside_a_sampled_controller_it_is_exact():
    """P control of 1/(s + 1): the torque changes in the middle of a sample."""
    dt, late, gain = 0.01, 0.0137, 4.0
    plant = ct.ss([[-1]], [[1]], [[1]], [[0]], inputs="ud", outputs="y", name="P")
    controller = static(lambda t, x, u, p: gain * (u[0] - u[1]), ["r", "y"], "u", "C", dt=dt)
    blocks = [plant, controller, lg.dead_time(late, inputs=["u"], outputs=["ud"])]
    t = dt * np.arange(101)
    y, u = [0.0], [0.0, 0.0]
    for _ in t[1:]:
        u.append(gain * (1 - y[-1]))
        x, split = y[-1], late - dt
        for length, torque in ((split, u[-3]), (dt - split, u[-2])):
            x = exp(-length) * x + (1 - exp(-length)) * torque
        y.append(x)
    assert np.abs(row(lg.simulate(blocks, t, {"r": 1.0}), "y") - y).max() < 1e-6


def test_a_dead_time_of_zero_passes_its_input():
    t = np.linspace(0, 1, 11)
    found = lg.simulate(lg.dead_time(0.0), t, np.sin(9 * t))
    np.testing.assert_array_equal(found.outputs, np.sin(9 * t))


def test_a_sweep_over_delays_is_the_simulation_of_each():
    blocks = [integrator("ud"), lg.dead_time(0.1, inputs=["r"], outputs=["ud"])]
    loop = ct.interconnect(blocks, inputs=["r"], outputs=["x"], params={}, name="loop")
    t, late = np.linspace(0, 1, 21), np.array([0.0, 0.02, 0.13])
    swept = lg.sweep(loop, t, 1.0, {"dead_time.delay": late}, outputs=["x"])
    for own, delay in zip(np.asarray(swept.y)[:, 0], late, strict=True):
        np.testing.assert_allclose(own, np.maximum(t - delay, 0.0), atol=1e-9)


def test_the_block_stays_a_pade_approximation_in_python_control():
    block, t = lg.dead_time(LATE), np.linspace(0, 0.1, 11)
    found = ct.input_output_response(block, t, np.ones(11), solve_ivp_kwargs={"rtol": 1e-9})
    assert found.outputs[0] == 1.0
    s = 1j * 0.5 / LATE
    response = block.linearize([0, 0], 0)(s)
    assert abs(response - np.exp(-s * LATE)) < 1e-3


def test_where_it_is_an_approximation_a_warning_says_so():
    t = np.linspace(0, 1, 11)
    with pytest.warns(RuntimeWarning, match="dead_time: .* 0.15 s is the Pade approximation"):
        lg.simulate(lg.dead_time(LATE), t, 1.0, method="Radau")
