"""Observers on the measured position alone: error equations, Lyapunov functions, scenarios."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg

from ..cases.observed import P, believing, cycle, follower, longer, position_error, velocity_error

few = st.floats(-2.0, 2.0)
GAINS = {"l1": 2719.1, "l2": 2.118e6, "l3": -5742.4}  # three poles at -1000 1/s at rest


def sign(x, eps=1e-4):
    return x / np.hypot(x, eps)


def error_matrix(a, b, gains, p=P):
    """Of that, what, zhat in the docstring."""
    l1, l2, l3 = gains
    return np.array(
        [
            [-l1, 1.0, 0.0],
            [-l2, -(p.sigma1 * b + p.Fv) / p.J, -(p.sigma0 - p.sigma1 * a) / p.J],
            [-l3, b, -a],
        ]
    )


def growth(gains, a, b=1.0):
    return np.linalg.eigvals(error_matrix(a, b, gains)).real.max()


# Coulomb friction.


@given(few, few, few, st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 2.0))
def test_position_coulomb_lyapunov_function_never_grows(w, what, u, a, ahat, k):
    """Along F = a sign(w) + Fv w, at every speed: -(J L + Fv) ew^2 - a ew (sign w - sign what)."""
    L, theta = 400.0, 0.3
    made = lg.position_coulomb_observer(P, k + 0.01, L)
    state = [theta - what / L, ahat + (k + 0.01) * np.hypot(what, 1e-4)]
    Fhat, found, speed = made.output(0.0, state, [theta, u])
    assert (found, speed) == (pytest.approx(ahat, abs=1e-9), pytest.approx(what, abs=1e-9))
    assert Fhat == pytest.approx(ahat * sign(what) + P.Fv * what, abs=1e-8)
    dthat, dzeta = made.dynamics(0.0, state, [theta, u])
    dw, dwhat = (u - a * sign(w) - P.Fv * w) / P.J, L * (w - dthat)
    dahat = dzeta - (k + 0.01) * sign(what) * dwhat
    ew, ea = w - what, a - ahat
    dV = P.J * ew * (dw - dwhat) - ea * dahat / ((k + 0.01) * L)
    expected = -(P.J * L + P.Fv) * ew**2 - a * ew * (sign(w) - sign(what))
    assert dV == pytest.approx(expected, rel=1e-6, abs=1e-6) and expected <= 0.0


def coulomb_drive(a):
    law = {"model": "coulomb", "Fc": a, "Fv": P.Fv}
    return lg.plant(lg.Model.of({"plant": {"J": P.J}, "friction": law}))


@pytest.mark.parametrize(("L", "rate"), [(400.0, 56.94), (200.0, 74.98)])
def test_position_coulomb_error_decays_by_the_slower_pole(L, rate):
    """Of x^2 + (L + Fv/J) x + k L/J, on a drive that slides."""
    poles = np.roots([1.0, L + P.Fv / P.J, 0.11 * L / P.J])
    assert max(poles.real) == pytest.approx(-rate, abs=0.3)
    t = np.arange(0.0, 0.15, 1e-3)
    blocks = [coulomb_drive(0.2), lg.position_coulomb_observer(P, 0.11, L)]
    out = lg.simulate(blocks, t, {"u": 0.25}, [0.0, 0.5, -0.5 / L, 0.11 * 0.5], rtol=1e-9)
    ahat = out.outputs[out.output_labels.index("ahat")]
    slope = np.polyfit(t[60:130], np.log(np.abs(0.2 - ahat[60:130])), 1)[0]
    assert -slope == pytest.approx(rate, rel=0.02)


@pytest.mark.parametrize(
    ("k", "L", "error", "digit"),
    [(0.11, 400.0, 0.0088, 1e-4), (0.11, 2000.0, 0.0185, 2e-4), (1.1, 4000.0, 0.0090, 1e-4)],
)
def test_position_coulomb_observer_in_the_velocity_loop(k, L, error, digit):
    """Whatever the believed level; Friedland-Park on the true w has 0.0214."""
    for believed in (P, believing(0.8)):
        found = velocity_error("position_coulomb", believed, k=k, gains={"L": L})
        assert found == pytest.approx(error, abs=digit)
    assert velocity_error("friedland_park", k=0.11) == pytest.approx(0.0214, abs=1e-4)


@longer
def test_position_coulomb_observer_in_position_loops():
    made = lg.position_coulomb_observer(P)
    assert position_error(follower(made)) == pytest.approx(2.9e-4, abs=1e-5)
    assert cycle("position_coulomb", 1.2) == pytest.approx(0.16e-3, abs=1e-5)
    assert cycle("friedland_park", 1.2) == pytest.approx(0.39e-3, abs=1e-5)


# The whole drive copied.


@given(few, few, st.floats(-2e-3, 2e-3), st.floats(-2e-3, 2e-3), st.floats(-0.01, 0.01), few)
def test_position_lugre_error_equation(w, what, z, zhat, m, u):
    """A(a, b) of the docstring with a at what, b = 1 - z (a(w) - a(what))/(w - what)."""

    def rate(x):
        return P.sigma0 * abs(x) / (P.Fc + (P.Fs - P.Fc) * np.exp(-((x / P.vs) ** 2)))

    gains = 900.0, 2e5, -100.0
    made = lg.position_lugre_observer(P, *gains)
    rates = made.dynamics(0.0, [0.2 - m, what, zhat], [0.2, u])
    dz = w - rate(w) * z
    dw = (u - P.sigma0 * z - P.sigma1 * dz - P.Fv * w) / P.J
    b_error = (w - what) - z * (rate(w) - rate(what))
    # b (w - what) stands for b_error, so that w = what needs no limit
    ew, ez, a = w - what, z - zhat, rate(what)
    expected = [
        -gains[0] * m + ew,
        -gains[1] * m
        - (P.sigma1 * b_error + P.Fv * ew) / P.J
        - (P.sigma0 - P.sigma1 * a) / P.J * ez,
        -gains[2] * m + b_error - a * ez,
    ]
    found = [w - rates[0], dw - rates[1], dz - rates[2]]
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-6 * (1 + abs(rate(w)) + a))


def in_sliding(gains):
    """The largest growth of an error in 1/s: the observer linearised at steady sliding."""
    made, found = lg.position_lugre_observer(P, *gains), []
    for w in np.geomspace(1e-4, 1.0, 60):
        z = (P.Fc + (P.Fs - P.Fc) * np.exp(-((w / P.vs) ** 2))) / P.sigma0
        A = ct.linearize(made, [0.0, w, z], [0.0, 0.4], eps=1e-8).A
        found.append(np.linalg.eigvals(A).real.max())
    return max(found)


def test_gains_decide_on_stability_in_sliding():
    """Three poles at -1000 hold at all corners; at -500 the falling friction near vs wins."""
    assert placed(1000.0) == pytest.approx(tuple(GAINS.values()), rel=1e-5)
    for a, b in [(a, b) for a in (0.0, P.sigma0 / P.Fc) for b in (-0.26, 2.26)]:
        assert growth(GAINS.values(), a, b) < -300.0
    assert in_sliding(GAINS.values()) == pytest.approx(-344.0, abs=2.0)
    assert in_sliding((900.0, 2e5, -100.0)) == pytest.approx(-3.0, abs=1.0)
    assert in_sliding(placed(500.0)) == pytest.approx(90.0, abs=1.0)


def placed(p):
    """l1, l2, l3 with three poles at -p at rest (a = 0, b = 1)."""
    c = (P.sigma1 + P.Fv) / P.J
    k = P.sigma0 / P.J
    l1 = 3 * p - c
    # det(s - A) = s^3 + (l1 + c) s^2 + (l2 + l1 c + k) s + k l1 - k l3
    return l1, 3 * p**2 - l1 * c - k, l1 - p**3 / k


@pytest.mark.parametrize(
    ("gains", "factor", "error", "digit"),
    [
        (None, 1.0, 0.00061, 1e-5),
        (None, 0.8, 0.0235, 1e-4),
        (GAINS, 0.8, 0.0080, 1e-4),
    ],
)
def test_position_lugre_observer_in_the_velocity_loop(gains, factor, error, digit):
    found = velocity_error("position_lugre", believing(factor), gains=gains)
    assert found == pytest.approx(error, abs=digit)


@longer
@pytest.mark.parametrize(
    ("factor", "error", "digit"), [(1.0, 2.3e-7, 1e-8), (0.8, 3.1e-3, 1e-4), (1.2, 2.7e-3, 1e-4)]
)
def test_position_lugre_observer_in_the_position_loop(factor, error, digit):
    made = lg.position_lugre_observer(believing(factor))
    assert position_error(follower(made)) == pytest.approx(error, abs=digit)


@longer
@pytest.mark.parametrize("factor", [1.2, 1.5])
def test_position_lugre_observer_does_not_cycle(factor):
    assert cycle("position_lugre", factor) < 1e-10
