"""What each friction law is known to do: loops, virgin curves, drift, memory."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

import lugrectl as lg
from lugrectl.engine.runtime import adaptive_run

from ..cases.laws import FC, FV, LAWS, S0, S1, VS, model_of, values_of


@pytest.fixture(autouse=True)
def interpreted(monkeypatch):
    """No machine code: compiling takes longer than these runs."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)


# theta = 0.01 sin 2 pi t, second period: F(1.0), F(1.26), area of the loop, RMS
LOOPS = [
    ("dahl", {}, ".28607 .27476 .010186 .26194"),
    ("lugre", {}, ".28608 .27584 .010234 .26263"),
    ("elastoplastic", {}, ".28613 .28658 .010184 .26908"),
    ("two_state", {}, ".28613 .28517 .010189 .26888"),
    ("maxwell_slip", {}, ".28613 .27980 .008676 .24560"),
    ("parallel_bristles", {}, ".27505 .28318 .008884 .24509"),
    ("leuven", {}, ".2501 .2758 .00849 .2337"),
    ("bouc_wen", {}, ".28605 .27980 .009874 .26234"),
    ("bouc_wen", {"n": 3.0}, ".28613 .27980 .010121 .26724"),
    ("bouc_wen", {"beta": 1.0, "n": 3.0}, ".28613 .27493 .010302 .26650"),
]


@pytest.mark.parametrize(("law", "own", "known"), LOOPS)
def test_the_loop_of_a_swing_has_the_known_figures(law, own, known):
    """Computed elsewhere from the same equations, to one unit of the last digit."""
    t = np.linspace(0.0, 2.0, 20001)
    w = 0.02 * np.pi * np.cos(2.0 * np.pi * t)
    F = lg.simulate(lg.friction(law, **own), t, w, rtol=1e-8).outputs
    again = slice(10000, None)
    area, size = trapezoid((F * w)[again], t[again]), np.sqrt(np.mean(F[again][:-1] ** 2))
    for value, text in zip((F[10000], F[12600], area, size), known.split(), strict=True):
        digits = len(text) - 1
        assert round(float(value), digits) == pytest.approx(float(text), abs=1.01 * 10.0**-digits)


def test_dahl_after_a_turn_is_an_exponential_of_the_distance():
    """From steady sliding: F = Fc (1 - 2 exp(-sigma0 x/Fc)), whatever the speed."""
    for speed in (0.01, 1.0):
        x = np.linspace(0.0, 5e-3, 51)
        w, made = np.full(51, speed), lg.friction("dahl", Fv=0.0)
        F = lg.simulate(made, x / speed, w, x0=[-FC / S0], rtol=1e-10).outputs
        np.testing.assert_allclose(F, FC * (1.0 - 2.0 * np.exp(-S0 * x / FC)), atol=1e-9)


def test_dahl_with_an_exponent_has_its_closed_form():
    """n = 2 from rest: 1 - F/Fc = 1/(1 + sigma0 x/Fc)."""
    x = np.linspace(0.0, 0.02, 41)
    F = lg.simulate(lg.friction("dahl", Fv=0.0, n=2.0), x, np.ones(41), rtol=1e-10).outputs
    np.testing.assert_allclose(F, FC * (1.0 - 1.0 / (1.0 + S0 * x / FC)), atol=1e-9)


def test_dahl_and_bouc_wen_are_lugre_without_damping_and_peak():
    random = np.random.default_rng(1)
    w, z = random.normal(size=(2, 50)) * [[0.5], [5e-4]]
    plain = lg.Model.of(friction="lugre").friction.block
    lugre = plain(w, z, sigma0=S0, sigma1=0.0, Fc=FC, Fs=FC, Fv=FV, vs=VS)
    dahl = LAWS["dahl"](w, z, sigma0=S0, Fc=FC, Fv=FV, n=1.0)
    bouc_wen = LAWS["bouc_wen"](w, z, sigma0=S0, Fc=FC, Fv=FV, beta=1.0, n=1.0)
    np.testing.assert_allclose(dahl, lugre, rtol=1e-12)
    np.testing.assert_allclose(bouc_wen, lugre, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("law", "drift"),
    [
        ("lugre", 11.5),
        ("dahl", 13.3),
        ("bouc_wen", 11.2),
        ("elastoplastic", 0.0),
        ("two_state", 0.0),
    ],
)
def test_under_a_small_oscillating_torque_only_an_elastic_zone_holds(law, drift):
    """0.15 + 0.04 sin(2 pi 20 t) N m, below breakaway: mrad/s from the second second on."""
    t = np.linspace(0.0, 2.0, 2001)
    u = 0.15 + 0.04 * np.sin(40.0 * np.pi * t)
    theta = lg.simulate(lg.plant(model_of(law)), t, [u, 0.0 * u]).outputs[0]
    assert 1e3 * (theta[2000] - theta[1000]) == pytest.approx(drift, abs=0.06)


def test_maxwell_slip_does_not_drift_beyond_what_its_smooth_edge_leaves():
    t = np.linspace(0.0, 2.0, 2001)
    u = 0.15 + 0.04 * np.sin(40.0 * np.pi * t)
    theta = lg.simulate(lg.plant(model_of("maxwell_slip")), t, [u, 0.0 * u]).outputs[0]
    assert abs(theta[2000] - theta[1000]) < 5e-6


def return_map(theta, N=4, Fc=FC):
    """Maxwell slip, exact for any motion: each spring is moved, then held at its limit."""
    k = np.array([2.0 * (N + 1 - i) / (N * (N + 1)) for i in range(1, N + 1)]) * S0
    limit = np.array([2.0 * i / (N * (N + 1)) for i in range(1, N + 1)]) * Fc
    F, kept = np.zeros(N), []
    for step in np.diff(theta, prepend=theta[0]):
        F = np.clip(F + k * step, -limit, limit)
        kept.append(F.sum())
    return np.array(kept)


@pytest.mark.parametrize("N", [1, 4, 7])
def test_maxwell_slip_is_its_return_map(N):
    t = np.linspace(0.0, 2.0, 4001)
    theta = 3e-3 * np.sin(2.0 * np.pi * t) + 1e-3 * np.sin(14.0 * np.pi * t)
    w = np.gradient(theta, t)
    moved = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t))])
    made = lg.friction("maxwell_slip", elements=N, Fv=0.0)
    F = lg.simulate(made, t, w, rtol=1e-8).outputs
    np.testing.assert_allclose(F, return_map(moved, N), atol=2e-4 * FC)


def test_maxwell_slips_virgin_curve_is_a_polygon():
    """Element i slips at x_i = nu_i Fc/k_i; in between the stiffness is that of those that hold."""
    x = np.linspace(0.0, 6e-3, 301)
    F = lg.simulate(lg.friction("maxwell_slip", Fv=0.0), x, np.ones(301), rtol=1e-9).outputs
    k, nu = S0 * np.array([0.4, 0.3, 0.2, 0.1]), FC * np.array([0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(F, np.minimum(np.outer(x, k), nu).sum(axis=1), atol=1e-4 * FC)
    turned = lg.simulate(
        lg.friction("maxwell_slip", Fv=0.0), x, -np.ones(301), x0=nu / k, rtol=1e-9
    ).outputs  # after a turn the virgin curve at double size
    double = FC - 2.0 * np.minimum(np.outer(0.5 * x, k), nu).sum(axis=1)
    np.testing.assert_allclose(turned, double, atol=2e-4 * FC)


NESTED = {"maxwell_slip": (-1e-4, 1e-4), "elastoplastic": (-2e-3, 1e-4)}
NESTED |= {"lugre": (-0.08, -0.04), "dahl": (-0.08, -0.04)}


@pytest.mark.parametrize("law", NESTED)
def test_a_small_loop_inside_a_large_one_closes_only_with_a_memory_of_turns(law):
    """F at 0.9 mrad after an excursion to 0.5 mrad, minus F before it, N m."""
    t = np.linspace(0.0, 1.8, 1801)
    theta = 1e-3 * np.interp(t, [0.0, 0.9, 1.3, 1.7, 1.8], [0.0, 0.9, 0.5, 0.9, 1.0])
    F = lg.simulate(lg.friction(law, Fv=0.0), t, np.gradient(theta, t)).outputs
    low, high = NESTED[law]
    assert low <= F[1700] - F[900] <= high


def test_frictional_lag_of_two_states_keeps_the_peak_for_a_while():
    """A drive that breaks away fast: the level is still Fs, and decays with tau."""
    made, values = values_of("two_state")
    tau = values["tau"]
    t = np.linspace(0.0, 4.0 * tau, 41)
    lost = lg.simulate(lg.friction("two_state"), t, np.full(41, 2.0), rtol=1e-9).states[1]
    np.testing.assert_allclose(lost, 1.0 - np.exp(-t / tau), atol=1e-7)
    slow = made(2.0, FC / S0, 0.0, **values)[1], made(2.0, FC / S0, 1.0, **values)[1]
    assert slow[0] > 0.0 and slow[1] == pytest.approx(0.0, abs=1e-9)


def test_elastoplastic_within_its_zone_is_a_spring():
    made, values = values_of("elastoplastic")
    z = 0.69 * FC / S0
    for w in (1e-3, -1e-3, 2.0):
        F, dz = made(w, z, **values)
        assert dz == w and F == pytest.approx(S0 * z + (S1 + FV) * w)
    assert (
        made(2.0, 0.9 * FC / S0, **values)[1] < 2.0 == made(-2.0, 0.9 * FC / S0, **values)[1] * -1
    )
