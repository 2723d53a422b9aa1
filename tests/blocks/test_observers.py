"""Observers against the friction law, their error equations, Lyapunov functions, closed forms."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY
from lugrectl.blocks.observers import observer

from ..cases.observed import P, believing
from ..cases.observed import relaxation as rate

OFF = replace(P, J=0.003, Fc=0.2, Fs=0.31, sigma0=300.0)
speeds, few = st.floats(-3.0, 3.0), st.floats(-2.0, 2.0)
moving = st.one_of(st.floats(0.01, 3.0), st.floats(-3.0, -0.01))
deflections = st.floats(-2e-3, 2e-3)
gains = st.floats(0.01, 5.0)
scales, excesses = st.floats(0.3, 3.0), st.floats(-0.9, 2.0)


def motion(w, z, u=0.0, p=P):
    """F, dw/dt and dz/dt of the plant without load."""
    F, dz = REGISTRY["friction", "lugre"](w, z, **p.friction())
    return F, (u - F) / p.J, dz


def parts(made, x, u):
    """Outputs by name and the rates."""
    y = made.output(0.0, np.atleast_1d(x), np.atleast_1d(u))
    return dict(zip(made.output_labels, y, strict=True)), made.dynamics(0.0, x, u)


def scaled(theta):
    """All of LuGre's friction but the viscous part scaled by theta, as by a normal force."""
    return replace(P, **{k: theta * getattr(P, k) for k in ("sigma0", "sigma1", "Fc", "Fs")})


@given(speeds, speeds, deflections, few)
def test_without_gains_every_observer_is_the_natural_one(w, what, zhat, u):
    natural, (dz,) = parts(lg.natural_observer(OFF), [zhat], [w])
    existing, rates = parts(lg.existing_observer(OFF, k=0.0), [zhat], [w, what])
    proposed, (dzp, dw) = parts(lg.proposed_observer(OFF, K1=0.0, K2=0.0), [zhat, what], [w, u])
    assert natural["Fhat"] == existing["Fhat"] == proposed["Fhat"]
    assert dz == rates[0] == dzp
    assert OFF.J * dw == pytest.approx(u - natural["Fhat"], abs=1e-12)
    adaptive, rates = parts(lg.adaptive_observer(OFF, gamma=0.0), [zhat, what, 0.0], [w, u])
    assert adaptive["Fhat"] == pytest.approx(natural["Fhat"], rel=1e-14, abs=1e-15)
    assert rates[2] == 0.0


def test_gains_may_be_functions_of_w():
    state, u = [1e-3, 0.3], [0.4, 0.1]
    fixed = lg.proposed_observer(P, K1=-7.0, K2=15.0)
    constant = lg.proposed_observer(P, K1=lambda w: -7.0 + 0.0 * w, K2=lambda w: 15.0 + 0.0 * w)
    assert np.array_equal(fixed.dynamics(0, state, u), constant.dynamics(0, state, u))
    assert np.array_equal(fixed.output(0, state, u), constant.output(0, state, u))
    scheduled = lg.proposed_observer(P, K1=lambda w: -10.0 * np.abs(w))
    number = lg.proposed_observer(P, K1=-10.0 * 0.4)
    assert np.array_equal(scheduled.dynamics(0, state, u), number.dynamics(0, state, u))
    assert "proposed_observer.K1" not in scheduled.params


def test_the_wrong_sign_of_K1_is_a_warning():
    with pytest.warns(RuntimeWarning, match="K1 = 10.24 makes the estimate unstable near rest"):
        made = lg.proposed_observer(P, K1=10.24)
    assert max(np.linalg.eigvals(ct.linearize(made, [0.0, 0.0], [0.0, 0.0]).A).real) > 0


def test_observers_take_their_values_from_what_is_known_of_a_drive():
    """A whole model, some values of one's own, and of Coulomb friction what they need."""
    model = lg.Model.of(OFF).with_effect("gravity", {"amplitude": 0.1, "phase": 0.0})
    assert lg.natural_observer(model).params == lg.natural_observer(OFF).params
    made = observer("existing", P, k=3.0, Fc=0.1, name="own")
    assert made.params["own.Fc"] == 0.1 and made.params["own.Fs"] == P.Fs
    incomplete = lg.Model.of(P).with_values({"Fc": None})
    assert observer("natural", incomplete, Fc=0.1).params["natural_observer.Fc"] == 0.1
    plain = lg.Model.of(J=P.J, friction="coulomb", Fc=0.285, Fv=0.018)
    for name in ("friedland_park", "disturbance", "extended_state"):
        assert observer(name, plain).params == observer(name, P).params


def power(k, mu):
    """G and dG/dw of k |w|^mu."""
    return lambda w: k * abs(w) ** mu, lambda w: k * mu * abs(w) ** (mu - 1) * np.sign(w)


def rounded(k, w0):
    """G and dG/dw of k (sqrt(w^2 + w0^2) - w0)."""
    return lambda w: k * (np.hypot(w, w0) - w0), lambda w: k * w / np.hypot(w, w0)


@given(moving, few, st.floats(0.0, 1.0), st.floats(-0.5, 1.5), gains, st.floats(0.01, 1.0))
def test_coulomb_observers_error_decays_by_the_slope_of_their_adaptation(w, u, a, zeta, k, other):
    """d(a - ahat)/dt = -(|dG/dw|/J) (a - ahat), by the chain rule along the plant."""
    mu, w0 = 1.0 + 2.0 * other, other
    for made, (G, slope) in (
        (observer("friedland_park", P, k=k, mu=mu, eps=1e-9), power(k, mu)),
        (observer("general_coulomb", P, k=k, w0=w0, eps=1e-9), rounded(k, w0)),
    ):
        dw = (u - a * np.sign(w) - P.Fv * w) / P.J
        out, (dzeta,) = parts(made, [zeta], [w, u])
        assert out["ahat"] == pytest.approx(zeta - G(w), rel=1e-9, abs=1e-12)
        decay = abs(slope(w)) / P.J
        found, size = slope(w) * dw - dzeta, 1e-8 * decay * (abs(u) + 9)
        assert found == pytest.approx(-decay * (a - out["ahat"]), rel=1e-8, abs=size)


@given(few, few, few, st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.01, 2.0))
def test_position_coulomb_lyapunov_function_never_grows(w, what, u, a, ahat, k):
    """Along F = a sign(w) + Fv w, at every speed: -(J L + Fv) ew^2 - a ew (sign w - sign what)."""

    def sign(x):
        return x / np.hypot(x, 1e-4)

    L, theta = 400.0, 0.3
    state = [theta - what / L, ahat + k * np.hypot(what, 1e-4)]
    out, (dthat, dzeta) = parts(lg.position_coulomb_observer(P, k, L), state, [theta, u])
    assert (out["ahat"], out["what"]) == pytest.approx((ahat, what), abs=1e-9)
    assert out["Fhat"] == pytest.approx(ahat * sign(what) + P.Fv * what, abs=1e-8)
    dw, dwhat = (u - a * sign(w) - P.Fv * w) / P.J, L * (w - dthat)
    dahat = dzeta - k * sign(what) * dwhat
    ew, ea = w - what, a - ahat
    dV = P.J * ew * (dw - dwhat) - ea * dahat / (k * L)
    expected = -(P.J * L + P.Fv) * ew**2 - a * ew * (sign(w) - sign(what))
    assert dV == pytest.approx(expected, rel=1e-6, abs=1e-6) and expected <= 0.0


@given(moving, few, few, st.floats(-1.0, 1.0), st.floats(1e-3, 1.0))
def test_disturbance_observer_follows_any_friction(w, u, F, v, tau):
    """tau dFhat/dt = F - Fhat whatever F is, along J dw/dt = u - F."""
    out, (dv,) = parts(lg.disturbance_observer(P, tau), [v], [w, u])
    dFhat = P.J * (dv - (u - F) / P.J) / tau
    size = 1e-9 * (1 + abs(out["Fhat"]))
    assert tau * dFhat == pytest.approx(F - out["Fhat"], rel=1e-9, abs=size)


def adaptive_growth(theta, w, u, z, zhat, what, excess, K2, gamma):
    """dV/dt of the docstring's V along the plant and the adaptive observer, and e."""
    made = lg.adaptive_observer(P, K2, gamma)
    _, dwhat, dexcess = made.dynamics(0.0, [zhat, what, excess], [w, u])
    dw = motion(w, z, u, scaled(theta))[1]
    e, q = w - what, theta - 1 - excess
    return P.J * e * (dw - dwhat) - q * dexcess * P.Fs**2 / (gamma * K2), e


@given(scales, moving, few, deflections, moving, excesses, gains, gains)
def test_adaptive_lyapunov_function_decays_by_K2_e_squared(theta, w, u, z, what, excess, K2, gamma):
    growth, e = adaptive_growth(theta, w, u, z, z, what, excess, K2, gamma)
    assert growth == pytest.approx(-K2 * e**2, rel=1e-6, abs=1e-6 * (1 + theta) * (1 + w**2))


@given(scales, speeds, st.floats(-1.0, 1.0), deflections, deflections, excesses)
def test_normal_force_estimate_error_is_filtered_by_the_bristles(theta, w, e, z, zhat, excess):
    """F - Fhat = (sigma1 d/dt + sigma0) q, q = theta ez + (theta - scale) zhat."""
    out, (dzhat, dexcess) = parts(lg.normal_force_observer(P), [zhat, excess], [w, e])
    dz = motion(w, z, p=scaled(theta))[2]
    F = theta * (P.sigma0 * z + P.sigma1 * dz) + P.Fv * w
    scale = 1 + excess
    dq = theta * dz - dexcess * zhat - scale * dzhat
    filtered = P.sigma0 * (theta * z - scale * zhat) + P.sigma1 * dq
    assert dexcess == pytest.approx(-2e3 * P.sigma0 * zhat * e) and out["scale"] == scale
    assert F - out["Fhat"] == pytest.approx(filtered, abs=1e-9 * (1 + abs(dq)))


@given(speeds, deflections, few, st.floats(-1.0, 1.0))
def test_the_measured_deflection_converges_without_a_friction_law(w, z, u, xi):
    """zbar - z decays at sigma0/sigma1 whatever h(w) is, also in motion."""
    made = lg.temperature_observer(believing(0.5))
    _, dw, dz = motion(w, z, u)
    _, _, dxi = made.dynamics(0.0, [0.0, 0.0, xi], [w, u])
    zbar, dzbar = (xi - P.J * w) / P.sigma1, (dxi - P.J * dw) / P.sigma1
    size = 1 + abs(dz) + abs(zbar) * P.sigma0 / P.sigma1
    assert dzbar - dz == pytest.approx(-P.sigma0 / P.sigma1 * (zbar - z), abs=1e-9 * size)


@given(scales, speeds, deflections, deflections, excesses, st.floats(0.0, 50.0), gains)
def test_temperature_lyapunov_function_never_grows(theta, w, z, zhat, excess, k, gamma):
    """With zbar = z, dV/dt = -(theta a + k) ez^2 for Fc and Fs divided by theta; at rest it
    waits."""
    made = lg.temperature_observer(P, k, gamma)
    state = [zhat, excess, P.sigma1 * z + P.J * w]
    dzhat, dexcess, _ = made.dynamics(0.0, state, [w, 0.1])
    ez, dez = z - zhat, motion(w, z, 0.1, believing(1 / theta))[2] - dzhat
    dV = ez * dez - (P.Fs / P.sigma0) ** 2 * (theta - 1 - excess) * dexcess / gamma
    expected = -(theta * rate(w) + k) * ez**2
    assert dV == pytest.approx(expected, rel=1e-6, abs=1e-10 * (1 + rate(w)))
    assert made.dynamics(0.0, state, [0.0, 0.1])[1] == 0.0


@given(
    speeds, speeds, deflections, st.floats(-0.5, 0.5), few, st.floats(10.0, 3e3), st.floats(0.5, 2)
)
def test_friction_state_error_equation(w, what, z, f, u, p, factor):
    """x' = [[-2p, -p], [p, -a]] x + (0, delta), delta by the wrong level; sigma1 = 0 there."""
    made = lg.friction_state_observer(believing(factor), p)
    dwhat, df = made.dynamics(0.0, [what, f], [w, u])
    _, dw, dz = motion(w, z, u, replace(P, sigma1=0.0))
    x = P.J * p * (w - what), P.sigma0 * z - f
    a = rate(w, believing(factor))
    expected = -2 * p * x[0] - p * x[1], p * x[0] - a * x[1] + (a - rate(w)) * P.sigma0 * z
    size = 1e-9 * (1 + p**2 + a) * (1 + abs(w) + abs(what))
    found = P.J * p * (dw - dwhat), P.sigma0 * dz - df
    assert found == pytest.approx(expected, abs=size)


@given(speeds, st.floats(-1.0, 1.0), deflections, deflections, st.floats(0.01, 200.0))
def test_lyapunov_function_of_the_velocity_loop_never_grows(w, e, z, zhat, k):
    """dV/dt = -kp e^2 - sigma0 a ez^2/k, at every speed, with the feed-forward J dr."""
    out, (dzhat,) = parts(lg.lyapunov_observer(P, k), [zhat], [w, e])
    kp, ki, q = 1.6, 0.16, 0.3
    F, _, dz = motion(w, z)
    ez, de = z - zhat, (-kp * e + ki * q + out["Fhat"] - F) / P.J
    dV = P.J * e * de + ki * q * (-e) + P.sigma0 * ez * (dz - dzhat) / k
    expected = -kp * e**2 - P.sigma0 * rate(w) * ez**2 / k
    assert dV == pytest.approx(expected, rel=1e-7, abs=1e-9 * (1 + rate(w)) * (1 + 1 / k))


def error_matrix(a, b, gains):
    """Of that, what, zhat in the docstring of the position observer."""
    l1, l2, l3 = gains
    speed = [-l2, -(P.sigma1 * b + P.Fv) / P.J, -(P.sigma0 - P.sigma1 * a) / P.J]
    return np.array([[-l1, 1.0, 0.0], speed, [-l3, b, -a]])


@given(few, few, deflections, deflections, st.floats(-0.01, 0.01), few)
def test_position_lugre_error_equation(w, what, z, zhat, m, u):
    """A(a, b) of the docstring with a at what, b = 1 - z (a(w) - a(what))/(w - what)."""
    gains = 900.0, 2e5, -100.0
    made = lg.position_lugre_observer(P, *gains)
    rates = made.dynamics(0.0, [0.2 - m, what, zhat], [0.2, u])
    _, dw, dz = motion(w, z, u)
    ew, ez, a = w - what, z - zhat, rate(what)
    bent = ew - z * (rate(w) - a)  # b ew, so that w = what needs no limit
    by_b = error_matrix(a, 1.0, gains)[:, 1] - error_matrix(a, 0.0, gains)[:, 1]
    expected = error_matrix(a, 0.0, gains) @ [m, ew, ez] + by_b * bent
    found = [w - rates[0], dw - rates[1], dz - rates[2]]
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-6 * (1 + abs(rate(w)) + a))


def in_sliding(gains):
    """The largest growth of an error in 1/s: the observer linearised at steady sliding."""
    made, found = lg.position_lugre_observer(P, *gains), []
    for w in np.geomspace(1e-3, 1.0, 25):
        A = ct.linearize(made, [0.0, w, w / rate(w)], [0.0, 0.4], eps=1e-8).A
        found.append(np.linalg.eigvals(A).real.max())
    return max(found)


def placed(p):
    return tuple(lg.design_gains(P, observer="position_lugre", pole=p).gains.values())


@pytest.mark.slow
def test_gains_decide_on_stability_in_sliding():
    """Three poles at -1000 hold at all corners; at -500 the falling friction near vs wins."""
    fast = placed(1000.0)
    assert fast == pytest.approx((2719.1, 2.118e6, -5742.4), rel=2e-4)
    for a, b in [(a, b) for a in (0.0, P.sigma0 / P.Fc) for b in (-0.26, 2.26)]:
        corner = np.linalg.eigvals(error_matrix(a, b, fast))
        assert corner.real.max() < -300.0
    assert in_sliding(fast) == pytest.approx(-344.0, abs=2.0)
    assert in_sliding((900.0, 2e5, -100.0)) == pytest.approx(-3.0, abs=1.0)
    assert in_sliding(placed(500.0)) == pytest.approx(90.0, abs=1.0)


# --- in a loop ----
