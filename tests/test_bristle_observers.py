"""Observers with corrected bristles: error equations, Lyapunov functions, the three scenarios."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg

from .observed import P, believing, cycle, follower, longer, position_error, velocity_error

speeds = st.floats(-3.0, 3.0)
deflections = st.floats(-2e-3, 2e-3)
torques = st.floats(-2.0, 2.0)


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
