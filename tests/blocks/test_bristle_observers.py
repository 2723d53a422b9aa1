"""Observers with corrected bristles: error equations, Lyapunov functions, the three scenarios."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg

from ..cases.observed import (
    P,
    believing,
    cycle,
    follower,
    longer,
    position_error,
    sampled_velocity_error,
    velocity_error,
)

speeds = st.floats(-3.0, 3.0)
deflections = st.floats(-2e-3, 2e-3)
torques = st.floats(-2.0, 2.0)
factors = st.floats(0.5, 2.0)


def rate(w, p=P):
    """a(w) = sigma0 |w|/h(w) in 1/s."""
    return p.sigma0 * abs(w) / (p.Fc + (p.Fs - p.Fc) * np.exp(-((w / p.vs) ** 2)))


def motion(p, w, z, u):
    """dw/dt and dz/dt of the plant."""
    _, dw, dz = lg.plant(p).dynamics(0.0, [0.0, w, z], [u, 0.0])
    return dw, dz


# Temperature: the level of h(w) unknown.


@given(speeds, deflections, torques, st.floats(-1.0, 1.0))
def test_the_measured_deflection_converges_without_a_friction_law(w, z, u, xi):
    """zbar - z decays at sigma0/sigma1 whatever h(w) is, also in motion."""
    made = lg.temperature_observer(believing(0.5))
    dw, dz = motion(P, w, z, u)
    _, _, dxi = made.dynamics(0.0, [0.0, 0.0, xi], [w, u])
    zbar = (xi - P.J * w) / P.sigma1
    dzbar = (dxi - P.J * dw) / P.sigma1
    size = 1 + abs(dz) + abs(zbar) * P.sigma0 / P.sigma1
    assert dzbar - dz == pytest.approx(-P.sigma0 / P.sigma1 * (zbar - z), abs=1e-9 * size)


@given(
    st.floats(0.3, 3.0),
    speeds,
    deflections,
    deflections,
    st.floats(-0.9, 2.0),
    st.floats(0.0, 50.0),
    st.floats(0.1, 50.0),
)
def test_temperature_lyapunov_function_never_grows(theta, w, z, zhat, excess, k, gamma):
    """With zbar = z, dV/dt = -(theta a + k) ez^2 for Fc and Fs divided by theta."""
    made = lg.temperature_observer(P, k, gamma)
    drive = believing(1 / theta)
    xi = P.sigma1 * z + P.J * w
    dzhat, dexcess, _ = made.dynamics(0.0, [zhat, excess, xi], [w, 0.1])
    ez, dez = z - zhat, motion(drive, w, z, 0.1)[1] - dzhat
    size = (P.Fs / P.sigma0) ** 2
    dV = ez * dez - size * (theta - 1 - excess) * dexcess / gamma
    expected = -(theta * rate(w) + k) * ez**2
    assert dV == pytest.approx(expected, rel=1e-6, abs=1e-10 * (1 + rate(w)))


def test_temperature_observer_removes_the_error_of_a_wrong_level():
    """The tracking error of exact parameters, with the level 20 % low; and at rest it waits."""
    assert velocity_error("temperature", believing(0.8)) == pytest.approx(0.00061, abs=1e-5)
    assert lg.temperature_observer(P).dynamics(0.0, [1e-3, 0.2, 0.0], [0.0, 0.1])[1] == 0.0


@pytest.mark.parametrize(
    ("believed", "k", "error", "digit"),
    [
        (believing(0.8, J=1.2 * P.J), 0.0, 0.00073, 1e-5),
        (believing(0.8, sigma1=0.5 * P.sigma1), 0.0, 0.0021, 1e-4),
        (believing(0.8, Fv=0.0), 0.0, 0.00072, 1e-5),
        (replace(P, Fc=0.8 * P.Fc, Fs=0.8 * P.Fc), 0.0, 0.00066, 1e-5),
        (believing(0.8, sigma0=0.7 * P.sigma0), 0.0, 0.0178, 1e-4),
        (believing(0.8, sigma0=0.7 * P.sigma0), 50.0, 0.0068, 1e-4),
    ],
)
def test_temperature_observer_with_a_second_wrong_parameter(believed, k, error, digit):
    assert velocity_error("temperature", believed, k=k) == pytest.approx(error, abs=digit)


@longer
@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_temperature_observer_reaches_the_floor_of_the_position_loop(factor):
    made = lg.temperature_observer(believing(factor))
    assert position_error(follower(made)) == pytest.approx(2.3e-7, abs=1e-8)
    if factor == 0.8:
        natural = follower(lg.natural_observer(believing(factor)))
        assert position_error(natural) == pytest.approx(3.1e-3, abs=1e-4)


@longer
def test_temperature_observer_does_not_cycle_with_friction_overestimated():
    assert cycle("temperature", 1.5) < 1e-11
    assert cycle("natural", 1.5) == pytest.approx(0.020, abs=1e-3)


# Friction as a state.


@given(speeds, speeds, deflections, st.floats(-0.5, 0.5), torques, st.floats(10.0, 3000.0), factors)
def test_friction_state_error_equation(w, what, z, f, u, p, factor):
    """x' = [[-2p, -p], [p, -a]] x + (0, delta), delta by the wrong level; sigma1 = 0 there."""
    drive = replace(P, sigma1=0.0)
    made = lg.friction_state_observer(believing(factor), p)
    dwhat, df = made.dynamics(0.0, [what, f], [w, u])
    dw, dz = motion(drive, w, z, u)
    x = P.J * p * (w - what), P.sigma0 * z - f
    believed = rate(w, believing(factor))
    expected = [
        -2 * p * x[0] - p * x[1],
        p * x[0] - believed * x[1] + (believed - rate(w)) * P.sigma0 * z,
    ]
    found = [P.J * p * (dw - dwhat), P.sigma0 * dz - df]
    size = 1e-9 * (1 + p**2 + believed) * (1 + abs(w) + abs(what))
    assert found == pytest.approx(expected, abs=size)


@pytest.mark.parametrize(
    ("bandwidth", "factor", "error", "digit"),
    [
        (200.0, 1.0, 0.0014, 1e-4),
        (200.0, 0.8, 0.0128, 1e-4),
        (500.0, 1.0, 0.00094, 1e-5),
        (500.0, 0.8, 0.0075, 1e-4),
        (2000.0, 1.0, 0.00068, 1e-5),
        (2000.0, 0.8, 0.0025, 1e-4),
    ],
)
def test_friction_state_observer_in_the_velocity_loop(bandwidth, factor, error, digit):
    found = velocity_error("friction_state", believing(factor), gains={"bandwidth": bandwidth})
    assert found == pytest.approx(error, abs=digit)


@longer
def test_sampled_observers_at_1_khz():
    low = believing(0.8)
    assert sampled_velocity_error(lg.friction_state_observer(low)) == pytest.approx(
        0.0076, abs=1e-4
    )
    scaled = lg.normal_force_observer(low, k=0.35)
    assert sampled_velocity_error(scaled) == pytest.approx(0.0029, rel=0.1)


def test_friction_state_observer_forgets_a_wrong_start_at_rest():
    """0.13 N m falls below 1e-4 in 20 ms, where the natural observer keeps it."""
    t = np.array([0.0, 0.02])
    start = lg.simulate(lg.friction_state_observer(P), t, {"w": 0.0, "u": 0.0}, [0.0, 0.13])
    assert start.outputs[0] == pytest.approx([0.13, 0.13 * 11 * np.exp(-10)], abs=1e-7)
    kept = lg.simulate(lg.natural_observer(P), t, {"w": 0.0}, [0.13 / P.sigma0])
    assert kept.outputs[0] == pytest.approx([0.13, 0.13], rel=1e-12)


def test_error_of_the_level_at_constant_speed():
    """F (a' - a)/(a' + p/2): 0.0179 N m at 0.1 rad/s with Fc and Fs 20 % low."""
    t, p, w = np.linspace(0.0, 0.5, 3), 500.0, 0.1
    level = P.sigma0 * w / rate(w)
    rows = {"w": w, "u": level + P.Fv * w}
    found = lg.simulate(lg.friction_state_observer(believing(0.8), p), t, rows, [w, 0.0])
    believed = rate(w) / 0.8
    expected = level * (believed - rate(w)) / (believed + p / 2)
    assert expected == pytest.approx(0.01786, abs=1e-5)
    assert level + P.Fv * w - found.outputs[0, -1] == pytest.approx(expected, rel=1e-3)


def test_without_a_law_it_is_the_extended_state_observer():
    made = lg.friction_state_observer(replace(P, sigma0=1e-9, Fv=0.0), 300.0)
    other = lg.extended_state_observer(P, 300.0)
    state, u = [0.2, 0.1], [0.3, 0.4]
    assert made.dynamics(0.0, state, u) == pytest.approx(other.dynamics(0.0, state, u), rel=1e-8)


# A normal force: everything but the viscous part scaled.


@given(
    st.floats(0.3, 3.0),
    speeds,
    st.floats(-1.0, 1.0),
    deflections,
    deflections,
    st.floats(-0.9, 2.0),
)
def test_normal_force_estimate_error_is_filtered_by_the_bristles(theta, w, e, z, zhat, excess):
    """F - Fhat = (sigma1 d/dt + sigma0) q, q = theta ez + (theta - scale) zhat."""
    made = lg.normal_force_observer(P)
    drive = replace(P, **{k: theta * getattr(P, k) for k in ("sigma0", "sigma1", "Fc", "Fs")})
    dz = motion(drive, w, z, 0.0)[1]
    F = theta * (P.sigma0 * z + P.sigma1 * dz) + P.Fv * w
    Fhat, _, scale = made.output(0.0, [zhat, excess], [w, e])
    dzhat, dexcess = made.dynamics(0.0, [zhat, excess], [w, e])
    q = theta * z - scale * zhat
    dq = theta * dz - dexcess * zhat - scale * dzhat
    assert dexcess == pytest.approx(-2e3 * P.sigma0 * zhat * e) and scale == 1 + excess
    assert F - Fhat == pytest.approx(P.sigma0 * q + P.sigma1 * dq, abs=1e-9 * (1 + abs(dq)))


@longer
@pytest.mark.parametrize("gamma", [2e3, 2e4, 2e5])
def test_normal_force_observer_finds_the_scale(gamma):
    believed = replace(P, **{k: 0.8 * getattr(P, k) for k in ("sigma0", "sigma1", "Fc", "Fs")})
    assert position_error(
        follower(lg.normal_force_observer(believed, gamma=gamma))
    ) == pytest.approx(2.3e-7, abs=1e-8)
    if gamma == 2e3:
        natural = position_error(follower(lg.natural_observer(believed)))
        existing = position_error(follower(lg.existing_observer(believed, k=1.0)))
        assert (natural, existing) == pytest.approx((3.1e-3, 3.0e-3), abs=1e-4)


# The exact cross term.


@given(speeds, st.floats(-1.0, 1.0), deflections, deflections, st.floats(0.01, 200.0))
def test_lyapunov_function_of_the_velocity_loop_never_grows(w, e, z, zhat, k):
    """dV/dt = -kp e^2 - sigma0^2 |w|/h ez^2/k, at every speed, with the feed-forward J dr."""
    made, kp, ki, q = lg.lyapunov_observer(P, k), 1.6, 0.16, 0.3
    (Fhat, _), (dzhat,) = (made.output(0, [zhat], [w, e]), made.dynamics(0, [zhat], [w, e]))
    dz = motion(P, w, z, 0.0)[1]
    F = P.sigma0 * z + P.sigma1 * dz + P.Fv * w
    ez, de = z - zhat, (-kp * e + ki * q + Fhat - F) / P.J
    dV = P.J * e * de + ki * q * (-e) + P.sigma0 * ez * (dz - dzhat) / k
    expected = -kp * e**2 - P.sigma0 * rate(w) * ez**2 / k
    assert dV == pytest.approx(expected, rel=1e-7, abs=1e-9 * (1 + rate(w)) * (1 + 1 / k))


@pytest.mark.parametrize(
    ("name", "k", "factor", "error", "digit"),
    [
        ("lyapunov", 0.35, 1.0, 0.00028, 1e-5),
        ("lyapunov", 0.35, 0.8, 0.0186, 1e-4),
        ("lyapunov", 20.0, 1.0, 1e-5, 1e-5),
        ("lyapunov", 20.0, 0.8, 0.00135, 1e-5),
        ("existing", 0.35, 1.0, 0.00025, 1e-5),
        ("existing", 0.35, 0.8, 0.0165, 1e-4),
        ("existing", 20.0, 1.0, 1e-5, 1e-5),
        ("existing", 20.0, 0.8, 0.00083, 1e-5),
    ],
)
def test_the_existing_observer_is_better_with_wrong_levels(name, k, factor, error, digit):
    assert velocity_error(name, believing(factor), k=k) == pytest.approx(error, abs=digit)


# Friction overestimated: the natural observer cycles.


@longer
@pytest.mark.parametrize(
    ("name", "factor", "swing"),
    [
        ("friction_state", 1.2, 0.0),
        ("friction_state", 1.5, 0.0),
        ("natural", 1.2, 0.0080),
        ("existing", 1.2, 0.0070),
        ("proposed", 1.5, 0.0),
        ("disturbance", 1.2, 0.0),
        ("extended_state", 1.2, 0.0),
    ],
)
def test_limit_cycles_with_friction_overestimated(name, factor, swing):
    assert cycle(name, factor) == pytest.approx(swing, abs=1e-4 if swing else 1e-11)
