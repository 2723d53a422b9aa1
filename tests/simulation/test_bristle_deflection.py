"""The deflection along a measured velocity against the law itself, step by step."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import lugrectl as lg
from lugrectl.simulation.sampled_block import deflection

P, DT = lg.table1(), 1e-3


def by_hand(w, dt, z):
    """The recursion of the docstring, with its limit at w = 0, in 80-bit numbers."""
    out = []
    for speed in np.asarray(w, dtype=np.longdouble):
        out.append(z)
        h = P.Fc + (P.Fs - P.Fc) * np.exp(-((speed / P.vs) ** 2))
        a = P.sigma0 * abs(speed) / h
        z = z + (-np.expm1(-a * dt) * (speed / a - z) if a > 0 else 0.0)
    return np.array(out, dtype=float)


def test_every_sample_follows_the_closed_form():
    random = np.random.default_rng(1)
    w = random.standard_normal(300) * 10.0 ** random.uniform(-9, 2, 300)
    w[40:60] = 0.0
    np.testing.assert_allclose(deflection(w, DT, P, 3e-4), by_hand(w, DT, 3e-4), rtol=1e-11)


@settings(max_examples=40)
@given(st.floats(-100.0, 100.0), st.floats(-2e-3, 2e-3))
def test_a_constant_velocity_relaxes_to_h_over_sigma0(w, z0):
    z = deflection(np.full(50, w), DT, P, z0)
    h = P.Fc + (P.Fs - P.Fc) * np.exp(-((w / P.vs) ** 2))
    end, a = np.sign(w) * h / P.sigma0, P.sigma0 * abs(w) / h
    exact = end + (z0 - end) * np.exp(-a * DT * np.arange(50)) if w else np.full(50, z0)
    # at creep the end is far away: compare with the way there
    np.testing.assert_allclose(z, exact, rtol=1e-9, atol=1e-15)


def test_a_held_velocity_is_what_the_law_itself_gives():
    w = np.repeat([0.0, 0.5, -0.02, 3.0, -3.0], 6)
    friction = lg.friction("lugre")
    z, kept = 2e-4, []
    for speed in w:
        kept.append(z)
        rate = lambda t, x, v=speed: friction.dynamics(0.0, x, [v])  # noqa: E731
        z = solve_ivp(rate, (0, DT), [z], method="Radau", rtol=1e-10, atol=1e-14).y[0, -1]
    np.testing.assert_allclose(deflection(w, DT, P, 2e-4), kept, rtol=1e-7, atol=1e-12)


def test_many_records_at_once():
    w = np.random.default_rng(3).standard_normal((3, 500))
    z = deflection(w, DT, P, [0.0, 1e-3, -1e-3])
    assert z.shape == (3, 500)
    np.testing.assert_array_equal(z[1], deflection(w[1], DT, P, 1e-3))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: deflection([0.0, np.nan], DT, P), "velocity is nan at sample 1"),
        (lambda: deflection([0.0], 0.0, P), "sample time"),
        (lambda: deflection(np.zeros((2, 2, 2)), DT, P), "must be"),
        (lambda: deflection(np.zeros((2, 5)), DT, P, [1.0, 2.0, 3.0]), "2 of them"),
    ],
)
def test_what_does_not_fit_is_said(call, said):
    with pytest.raises(lg.InputError, match=said):
        call()
