"""Observers to compare with, against their error equations, transfer functions and LuGre."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY
from lugrectl.blocks.model import model_from_dict
from lugrectl.blocks.observers import (
    adaptive_observer,
    disturbance_observer,
    extended_state_observer,
    friedland_park_observer,
    observer,
)
from lugrectl.loops.friction_loops import position_loop, velocity_loop
from lugrectl.simulation.response import simulate

from ..cases.observed import longer, sampled_velocity_error, velocity_error

P = lg.table1()
MADE = [friedland_park_observer, disturbance_observer, extended_state_observer, adaptive_observer]
NAMES = ["friedland_park", "disturbance", "extended_state", "adaptive"]
OMEGA = np.array([0.3, 4.0, 90.0, 800.0])
s = ct.tf("s")
speeds = st.one_of(st.floats(0.01, 3.0), st.floats(-3.0, -0.01))
deflections = st.floats(-2e-3, 2e-3)
torques = st.floats(-2.0, 2.0)
gains = st.floats(0.01, 5.0)


def named(system, x, u):
    y = system.output(0.0, np.atleast_1d(x), np.atleast_1d(u))
    return dict(zip(system.output_labels, y, strict=True))


def wired(plant, estimate, outputs, inputs=("u", "d")):
    return ct.interconnect(
        [plant, estimate],
        inputs=list(inputs),
        outputs=list(outputs),
        params={},
        check_unused=False,
    )


def transfer(system, output, input):
    linear = ct.linearize(system, np.zeros(system.nstates), np.zeros(system.ninputs))
    i, j = system.output_labels.index(output), system.input_labels.index(input)
    return np.array([linear(1j * w, squeeze=False)[i, j] for w in OMEGA])


def frictionless():
    """J dw/dt = u - d."""
    viscous = {"plant": {"J": P.J}, "friction": {"model": "viscous", "Fv": 0.0}}
    return lg.plant(model_from_dict(viscous, "here"))


def coulomb(level):
    """J dw/dt = u - level sign(w) - Fv w."""
    law = {"model": "coulomb", "Fc": level, "Fv": P.Fv}
    return lg.plant(model_from_dict({"plant": {"J": P.J}, "friction": law}, "here"))


def scaled(theta):
    """All of LuGre's friction but the viscous part scaled by theta."""
    grown = {k: theta * getattr(P, k) for k in ("sigma0", "sigma1", "Fc", "Fs")}
    return replace(P, **grown)


# Friedland-Park.


@given(speeds, torques, st.floats(0.0, 1.0), st.floats(-0.5, 1.5), gains, st.floats(1.0, 3.0))
def test_friedland_park_error_on_coulomb_friction(w, u, a, zeta, k, mu):
    """d(a - ahat)/dt = -k mu |w|^(mu - 1) (a - ahat) / J, by the chain rule along the plant."""
    made = observer("friedland_park", P, k=k, mu=mu, eps=1e-9)
    dw = (u - a * np.sign(w) - P.Fv * w) / P.J
    ahat = named(made, [zeta], [w, u])["ahat"]
    assert ahat == pytest.approx(zeta - k * abs(w) ** mu, rel=1e-9, abs=1e-12)
    (dzeta,) = made.dynamics(0.0, [zeta], [w, u])
    dahat = dzeta - k * mu * abs(w) ** (mu - 1) * np.sign(w) * dw
    rate = k * mu * abs(w) ** (mu - 1) / P.J
    assert -dahat == pytest.approx(-rate * (a - ahat), rel=1e-8, abs=1e-8 * rate * (abs(u) + 5))


@pytest.mark.parametrize(("k", "mu"), [(0.02, 1.0), (0.05, 1.7)])
def test_friedland_park_converges_on_a_coulomb_drive(k, mu):
    """The error is that at the start times exp(-integral of k mu |w|^(mu - 1) / J)."""
    t = np.arange(0, 0.5, 1e-3)
    system = wired(coulomb(0.2), friedland_park_observer(P, k, mu), ["w", "ahat"])
    w, ahat = simulate(system, t, [0.25 + 0.1 * np.sin(20 * t), 0 * t], [0, 0.5, 0]).outputs
    rate = k * mu * np.abs(w) ** (mu - 1) / P.J
    decay = np.concatenate([[0], np.cumsum(0.5e-3 * (rate[1:] + rate[:-1]))])
    assert np.all(w > 0.1)
    assert 0.2 - ahat == pytest.approx((0.2 - ahat[0]) * np.exp(-decay), abs=1e-5)
    assert abs(0.2 - ahat[-1]) < 0.1 * abs(0.2 - ahat[0])


@pytest.mark.parametrize("mu", [1.5, 2.0, 4.0])
def test_friedland_park_rests_with_the_drive(mu):
    made = friedland_park_observer(P, 0.5, mu)
    assert made.dynamics(0.0, [0.3], [0.0, 0.1]) == 0.0
    assert np.isfinite(ct.linearize(made, [0.3], [0.0, 0.1]).A).all()


# The two that know no friction law.


@pytest.mark.parametrize("tau", [1e-3, 0.02, 0.3])
def test_disturbance_observer_is_a_lag_of_the_disturbance(tau):
    system = wired(frictionless(), disturbance_observer(P, tau), ["Fhat"])
    assert transfer(system, "Fhat", "d") == pytest.approx(1 / (tau * 1j * OMEGA + 1), rel=1e-5)
    assert abs(transfer(system, "Fhat", "u")).max() < 1e-5


@given(speeds, torques, torques, st.floats(-1.0, 1.0), st.floats(1e-3, 1.0))
def test_disturbance_observer_follows_any_friction(w, u, F, v, tau):
    """tau dFhat/dt = F - Fhat whatever F is, along J dw/dt = u - F."""
    made = disturbance_observer(P, tau)
    Fhat = named(made, [v], [w, u])["Fhat"]
    (dv,) = made.dynamics(0.0, [v], [w, u])
    dFhat = P.J * (dv - (u - F) / P.J) / tau
    assert tau * dFhat == pytest.approx(F - Fhat, rel=1e-9, abs=1e-9 * (1 + abs(Fhat)))


@pytest.mark.parametrize("bandwidth", [5.0, 100.0, 3000.0])
def test_extended_state_observer_has_both_poles_at_the_bandwidth(bandwidth):
    made = extended_state_observer(P, bandwidth)
    A = ct.linearize(made, [0.0, 0.0], [0.0, 0.0]).A
    assert np.poly(A) == pytest.approx([1.0, 2 * bandwidth, bandwidth**2], rel=1e-5)
    system = wired(frictionless(), made, ["Fhat"])
    found = transfer(system, "Fhat", "d")
    assert found == pytest.approx(1 / (1j * OMEGA / bandwidth + 1) ** 2, rel=1e-4)
    assert abs(transfer(system, "Fhat", "u")).max() < 1e-4
    noise = np.abs(transfer(wired(frictionless(), made, ["Fhat"], ["w"]), "Fhat", "w"))
    assert noise.max() <= 0.5 * P.J * bandwidth * (1 + 1e-6)


# Adaptive LuGre: the derivation in its docstring.


def lyapunov_rate(theta, w, u, z, zhat, what, excess, K2, gamma):
    """dV/dt of the docstring's V along the plant and the observer, and e."""
    made = adaptive_observer(P, K2, gamma)
    _, dw, _ = lg.plant(scaled(theta)).dynamics(0.0, [0.0, w, z], [u, 0.0])
    _, dwhat, dexcess = made.dynamics(0.0, [zhat, what, excess], [w, u])
    e, q = w - what, theta - 1 - excess
    return P.J * e * (dw - dwhat) - q * dexcess * P.Fs**2 / (gamma * K2), e


@given(
    st.floats(0.3, 3.0), speeds, torques, deflections, speeds, st.floats(-0.9, 3.0), gains, gains
)
def test_adaptive_lyapunov_function_decays_by_K2_e_squared(theta, w, u, z, what, excess, K2, gamma):
    rate, e = lyapunov_rate(theta, w, u, z, z, what, excess, K2, gamma)
    assert rate == pytest.approx(-K2 * e**2, rel=1e-6, abs=1e-6 * (1 + theta) * (1 + w**2))


@given(st.floats(0.3, 3.0), speeds, deflections, deflections, speeds, st.floats(-0.9, 3.0))
def test_adaptive_disturbance_by_an_error_of_zhat(theta, w, z, zhat, what, excess):
    """It enters J de/dt as -theta (sigma0 - sigma1 sigma0 |w|/h)(z - zhat)."""
    rate, e = lyapunov_rate(theta, w, 0.3, z, zhat, what, excess, 1.0, 10.0)
    slip = abs(w) / (P.Fc + (P.Fs - P.Fc) * np.exp(-((w / P.vs) ** 2)))
    term = -theta * P.sigma0 * (1 - P.sigma1 * slip) * (z - zhat) * e
    size = (1 + theta) * (1 + w**2) * (1 + what**2)
    assert rate == pytest.approx(-(e**2) + term, rel=1e-6, abs=1e-6 * size)


@pytest.mark.parametrize("theta", [0.6, 1.5])
def test_adaptive_observer_finds_the_scale(theta):
    """Also from a wrong zhat: gamma = 10 1/s, over 1.5 s."""
    t = np.arange(0, 1.5, 2e-3)
    system = wired(lg.plant(scaled(theta)), adaptive_observer(P), ["w", "F", "Fhat", "scale"])
    u = 0.9 * np.sign(np.sin(2 * np.pi * t)) * theta
    w, F, Fhat, scale = simulate(system, t, [u, 0 * t], [0, 0, 0, -1e-3]).outputs
    assert scale[0] == 1.0 and scale[-1] == pytest.approx(theta, rel=2e-3)
    assert Fhat[-100:] == pytest.approx(F[-100:], abs=5e-3)


def test_adaptive_observer_without_adaptation_is_the_natural_one():
    made, natural = adaptive_observer(P, gamma=0.0), lg.natural_observer(P)
    out = named(made, [1e-3, 0.3, 0.0], [0.2, 0.1])
    assert out["Fhat"] == pytest.approx(named(natural, [1e-3], [0.2])["Fhat"], rel=1e-14)
    assert made.dynamics(0.0, [1e-3, 0.3, 0.0], [0.2, 0.1])[2] == 0.0


# What all of them promise.


@pytest.mark.parametrize("name", NAMES)
def test_estimate_in_steady_sliding_is_the_friction(name):
    """LuGre plant 30 % above the observer's belief; no law, or its scale, is identified."""
    loop = velocity_loop(scaled(1.3), name, observer_parameters=P)
    t = np.arange(0, 3.0, 5e-3)
    for speed in (-0.15, 0.15):
        resp = simulate(loop, t, speed * np.minimum(t, 1))
        F, Fhat = (resp.outputs[resp.output_labels.index(k)] for k in ("F", "Fhat"))
        assert abs(F[-1]) > 0.37 and F[-1] * speed > 0
        assert Fhat[-1] == pytest.approx(F[-1], abs=3e-3)


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data())
def test_the_mirrored_drive_has_the_mirrored_estimate(name, data):
    """Signals and odd states change sign, levels and scales do not."""
    made = REGISTRY[f"{name}_observer"]
    signs = [1.0 if k in ("zeta", "excess") else -1.0 for k in (*made.inputs, *made.states)]
    args = [data.draw(st.floats(-2.0, 2.0)) for _ in signs]
    one = made(*args, **made.defaults())
    other = made(*[a * b for a, b in zip(args, signs, strict=True)], **made.defaults())
    fresh = [k for k in made.outputs if k not in made.states]
    even = ("zeta", "excess", "ahat", "scale")
    for k, a, b in zip([*fresh, *made.states], one, other, strict=True):
        assert a == (b if k in even else -b)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("make", [velocity_loop, position_loop])
def test_ready_loops_take_them_by_name(name, make):
    loop = make(P, name)
    made = loop.syslist[1]
    assert made.name == f"{name}_observer"
    declared = REGISTRY[made.name].parameters
    for key in set(declared) - {"J", *P.friction()}:
        assert made.params[f"{made.name}.{key}"] == declared[key].value
    assert np.isfinite(loop.dynamics(0.0, np.full(loop.nstates, 1e-3), [0.1])).all()


def test_other_gains_reach_the_observer():
    def params(name, **options):
        return velocity_loop(P, name, **options).syslist[1].params

    assert params("disturbance", gains={"tau": 0.003})["disturbance_observer.tau"] == 0.003
    assert params("friedland_park", k=0.02)["friedland_park_observer.k"] == 0.02
    assert params("proposed")["proposed_observer.K1"] == -10.24
    assert params("proposed", gains={"K2": 5.0})["proposed_observer.K2"] == 5.0
    with pytest.raises(lg.InputError, match="no parameter 'bandwidth'"):
        velocity_loop(P, "disturbance", gains={"bandwidth": 3.0})


@pytest.mark.parametrize("name", ["friedland_park", "adaptive"])
def test_engine_and_python_control_agree(name):
    t = np.arange(0, 0.0601, 2e-3)
    loop, r = velocity_loop(P, name), 0.3 * np.sin(30 * t)
    fast = simulate(loop, t, r, rtol=1e-8).outputs
    options = {"rtol": 1e-8, "atol": 1e-11}
    slow = ct.input_output_response(
        loop, t, r, solve_ivp_method="LSODA", solve_ivp_kwargs=options
    ).outputs
    np.testing.assert_allclose(fast, slow, atol=1e-5)


def test_only_what_is_needed_is_asked_for():
    law = {"plant": {"J": P.J}, "friction": {"model": "coulomb", "Fc": 0.285, "Fv": 0.018}}
    model = model_from_dict(law, "here")
    for make in MADE[:3]:
        assert make(model).params == make(P).params
    with pytest.raises(lg.InputError, match="adaptive_observer needs sigma0"):
        adaptive_observer(model)


@pytest.mark.parametrize(
    "call",
    [
        lambda: friedland_park_observer(P, k=-1.0),
        lambda: friedland_park_observer(P, mu=0.5),
        lambda: disturbance_observer(P, tau=0.0),
        lambda: extended_state_observer(P, bandwidth=-1.0),
        lambda: adaptive_observer(P, gamma=-1.0),
        lambda: disturbance_observer(lg.Model.of(P).with_values({"J": None})),
    ],
)
def test_wrong_usage_is_one_sentence(call):
    with pytest.raises(lg.InputError) as raised:
        call()
    assert "\n" not in str(raised.value) and str(raised.value).endswith(".")


# The generalised adaptation function.


@given(speeds, torques, st.floats(0.0, 1.0), st.floats(-0.5, 1.5), gains, st.floats(0.01, 1.0))
def test_general_coulomb_error_on_coulomb_friction(w, u, a, zeta, k, w0):
    """d(a - ahat)/dt = -(G'/J) (a - ahat), G = k (sqrt(w^2 + w0^2) - w0), along the plant."""
    made = observer("general_coulomb", P, k=k, w0=w0, eps=1e-9)
    dw = (u - a * np.sign(w) - P.Fv * w) / P.J
    ahat = named(made, [zeta], [w, u])["ahat"]
    slope = k * w / np.hypot(w, w0)
    (dzeta,) = made.dynamics(0.0, [zeta], [w, u])
    rate = abs(slope) / P.J
    assert slope * dw - dzeta == pytest.approx(-rate * (a - ahat), abs=1e-8 * rate * (abs(u) + 9))
    assert ahat == pytest.approx(zeta - k * (np.hypot(w, w0) - w0), rel=1e-9, abs=1e-12)
    assert made.dynamics(0.0, [zeta], [0.0, u]) == 0.0  # nothing is adapted at rest


@pytest.mark.parametrize(
    ("k", "w0", "error", "digit"),
    [(0.11, 0.1, 0.0216, 1e-4), (1.1, 0.1, 0.0134, 2e-4), (1.1, 0.01, 0.0090, 1e-4)],
)
def test_general_coulomb_observer_in_the_velocity_loop(k, w0, error, digit):
    found = velocity_error("general_coulomb", k=k, gains={"w0": w0})
    assert found == pytest.approx(error, abs=digit)


@longer
def test_general_coulomb_observer_sampled_at_1_khz():
    found = sampled_velocity_error(lg.general_coulomb_observer(P))
    assert found == pytest.approx(0.0218, abs=1e-4)
