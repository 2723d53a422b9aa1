"""Observers against the LuGre law, the paper's error equations and closed forms."""

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
    existing_observer,
    natural_observer,
    observer,
    proposed_observer,
)

P = lg.table1()
OFF = replace(P, J=0.003, Fc=0.2, Fs=0.31, sigma0=300.0)
speeds = st.floats(-3.0, 3.0)
deflections = st.floats(-2e-3, 2e-3)
torques = st.floats(-2.0, 2.0)


def h(p, w):
    return p.Fc + (p.Fs - p.Fc) * np.exp(-((w / p.vs) ** 2))


def friction_of(p, w, z):
    """F and dz/dt of the plant's own LuGre block."""
    return REGISTRY["lugre"](w, z, **p.friction())


def parts(system, x, u):
    """Outputs by name and the rates."""
    y = system.output(0.0, np.atleast_1d(x), np.atleast_1d(u))
    return dict(zip(system.output_labels, y, strict=True)), system.dynamics(0.0, x, u)


@given(speeds, deflections)
def test_natural_observer_in_the_plants_state_is_the_friction(w, z):
    out, (dz,) = parts(natural_observer(P), [z], [w])
    F, rate = friction_of(P, w, z)
    assert out == {"Fhat": pytest.approx(F, rel=1e-14), "zhat": z}
    assert dz == pytest.approx(rate, rel=1e-14)


@given(speeds, deflections, deflections)
def test_natural_observer_error_follows_the_corrected_equations(w, z, zhat):
    """e_z' = -sigma0 |w|/h e_z and e_f = sigma0 (1 - sigma1 |w|/h) e_z, for equal parameters."""
    out, (dz,) = parts(natural_observer(P), [zhat], [w])
    F, rate = friction_of(P, w, z)
    slip, ez = abs(w) / h(P, w), z - zhat
    assert rate - dz == pytest.approx(-P.sigma0 * slip * ez, abs=1e-12)
    assert F - out["Fhat"] == pytest.approx(P.sigma0 * (1 - P.sigma1 * slip) * ez, abs=1e-12)


@given(speeds, st.floats(-1.0, 1.0), deflections, st.floats(0.0, 30.0))
def test_existing_observer_adds_minus_k_e(w, e, zhat, k):
    out, (dz,) = parts(existing_observer(P, k=k), [zhat], [w, e])
    F, rate = friction_of(P, w, zhat)
    assert dz == pytest.approx(rate - k * e, rel=1e-13, abs=1e-13)
    assert out["Fhat"] == pytest.approx(F - P.sigma1 * k * e, rel=1e-13, abs=1e-13)


@given(speeds, speeds, deflections, deflections, torques)
def test_proposed_observer_error_follows_the_papers_equations(w, what, z, zhat, u):
    """err_z_dot_new and err_w_dot_new of the source paper, the plant with d = 0."""
    K1, K2 = -10.24, 22.0
    _, (dz, dw) = parts(proposed_observer(P, K1=K1, K2=K2), [zhat, what], [w, u])
    _, dw_plant, dz_plant = lg.plant(P).dynamics(0.0, [0.0, w, z], [u, 0.0])
    slip, ez, ew = P.sigma0 * abs(w) / h(P, w), z - zhat, w - what
    K3 = (K2 - P.sigma1 * K1) / P.J
    assert dz_plant - dz == pytest.approx(-slip * ez - K1 * ew, abs=1e-10)
    assert dw_plant - dw == pytest.approx(
        (-P.sigma0 + P.sigma1 * slip) / P.J * ez - K3 * ew, rel=1e-10, abs=1e-6
    )


@given(speeds, speeds, deflections, torques)
def test_torque_of_the_proposed_observer_contains_the_correction(w, what, zhat, u):
    out, (dz, _) = parts(proposed_observer(OFF), [zhat, what], [w, u])
    assert out["Fhat"] == pytest.approx(OFF.sigma0 * zhat + OFF.sigma1 * dz + OFF.Fv * w)
    assert out["what"] == what


@given(speeds, speeds, deflections, torques)
def test_without_gains_every_observer_is_the_natural_one(w, what, zhat, u):
    natural, (dz,) = parts(natural_observer(OFF), [zhat], [w])
    existing, rates = parts(existing_observer(OFF, k=0.0), [zhat], [w, what])
    proposed, (dzp, dw) = parts(proposed_observer(OFF, K1=0.0, K2=0.0), [zhat, what], [w, u])
    assert natural["Fhat"] == existing["Fhat"] == proposed["Fhat"]
    assert dz == rates[0] == dzp
    assert OFF.J * dw == pytest.approx(u - natural["Fhat"], abs=1e-12)


def test_existing_observer_in_a_position_loop_takes_the_position_error():
    made = existing_observer(P, inputs=["w", "e_theta"], name="outer")
    assert made.input_labels == ["w", "e_theta"]
    assert "outer.k" in made.params


def test_gains_may_be_functions_of_w():
    state, u = [1e-3, 0.3], [0.4, 0.1]
    fixed = proposed_observer(P, K1=-7.0, K2=15.0)
    constant = proposed_observer(P, K1=lambda w: -7.0 + 0.0 * w, K2=lambda w: 15.0 + 0.0 * w)
    assert np.array_equal(fixed.dynamics(0, state, u), constant.dynamics(0, state, u))
    assert np.array_equal(fixed.output(0, state, u), constant.output(0, state, u))
    scheduled = proposed_observer(P, K1=lambda w: -10.0 * np.abs(w))
    number = proposed_observer(P, K1=-10.0 * 0.4)
    assert np.array_equal(scheduled.dynamics(0, state, u), number.dynamics(0, state, u))
    assert "proposed_observer.K1" not in scheduled.params


def test_error_poles_at_rest():
    """Roots of s^2 + K3 s - K1 sigma0/J, the slower at -95.3 1/s with the paper's gains."""
    A = ct.linearize(proposed_observer(P), [0.0, 0.0], [0.0, 0.0]).A
    K3 = (22 + P.sigma1 * 10.24) / P.J
    assert np.sort(np.linalg.eigvals(A)) == pytest.approx(
        np.sort(np.roots([1.0, K3, 10.24 * P.sigma0 / P.J])), rel=1e-6
    )
    assert max(np.linalg.eigvals(A)) == pytest.approx(-95.3, abs=0.05)


@pytest.mark.filterwarnings("ignore:.*K1 = .* unstable near rest:RuntimeWarning")
def test_positive_K1_runs_away_at_rest():
    A = ct.linearize(proposed_observer(P, K1=10.24), [0.0, 0.0], [0.0, 0.0]).A
    assert max(np.linalg.eigvals(A).real) > 0


def test_estimate_converges_like_the_closed_form_at_constant_speed():
    """e_z = e_z(0) exp(-sigma0 |w| t/h); zhat ends at h sign(w)/sigma0."""
    w, t = -0.02, np.linspace(0, 0.3, 31)
    resp = ct.input_output_response(
        natural_observer(P),
        t,
        np.full_like(t, w),
        [1e-3],
        solve_ivp_method="LSODA",
        solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-13},
    )
    end = -h(P, w) / P.sigma0
    expected = end + (1e-3 - end) * np.exp(-P.sigma0 * abs(w) / h(P, w) * t)
    assert resp.outputs[1] == pytest.approx(expected, abs=1e-9)


def test_names_and_keys_belong_to_the_block():
    made = proposed_observer(OFF, K2=5.0, name="second", outputs=["Fb", "zb", "wb"])
    assert made.input_labels == ["w", "u"] and made.output_labels == ["Fb", "zb", "wb"]
    assert made.state_labels == ["zhat", "what"]
    assert all(key.startswith("second.") for key in made.params)
    assert made.params["second.Fc"] == OFF.Fc and made.params["second.K2"] == 5.0


def test_a_whole_model_gives_the_observer_its_friction():
    model = lg.Model.of(OFF).with_effect("gravity", {"amplitude": 0.1, "phase": 0.0})
    assert natural_observer(model).params == natural_observer(OFF).params


def test_observer_by_name_with_one_value_of_its_own():
    made = observer("existing", P, k=3.0, Fc=0.1, name="own")
    assert made.params["own.Fc"] == 0.1 and made.params["own.Fs"] == P.Fs
    incomplete = lg.Model.of(P).with_values({"Fc": None})
    assert observer("natural", incomplete, Fc=0.1).params["natural_observer.Fc"] == 0.1


def test_a_model_without_lugre_friction_is_refused():
    coulomb = {"plant": {"J": 1e-3}, "friction": {"model": "coulomb", "Fc": 0.1, "Fv": 0.01}}
    with pytest.raises(lg.InputError, match="natural_observer needs sigma0, sigma1, Fs, vs"):
        natural_observer(model_from_dict(coulomb, "here"))
    with pytest.raises(lg.InputError, match="proposed_observer needs J"):
        proposed_observer(lg.Model.of(P).with_values({"J": None}))


@pytest.mark.parametrize(
    "call",
    [
        lambda: observer("nonsense", P),
        lambda: observer("natural", P, K1=3.0),
        lambda: existing_observer(P, k=-1.0),
        lambda: proposed_observer(P, K1=float("nan")),
        lambda: proposed_observer(P, K2="22"),
        lambda: natural_observer(P, outputs=["Fhat"]),
    ],
)
def test_wrong_usage_is_one_sentence(call):
    with pytest.raises(lg.InputError) as raised:
        call()
    assert "\n" not in str(raised.value) and str(raised.value).endswith(".")
