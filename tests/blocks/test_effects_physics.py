"""Effects against closed forms: torques, levels, their order, and the laws they complete."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg

from ..cases.drives import EFFECTS, J, arguments, free, model_of, plant_of, run

TURNS = 2.0 * np.pi

# Torques, against the contract's formulas written out again.

T, THETA, W = 1.7, 0.9, -2.3
TORQUES = {
    "constant_torque": ({"torque": -0.3}, -0.3),
    "gravity": ({"amplitude": 0.4, "phase": 0.5}, 0.4 * np.sin(1.4)),
    "torque_ripple": ({"amplitude": 0.4, "harmonic": 3.0, "phase": 0.5}, 0.4 * np.sin(3.2)),
    "return_spring": ({"stiffness": 2.0, "rest": 0.4}, 1.0),
    "periodic_disturbance": (
        {"amplitude": 0.2, "frequency": 5.0, "phase": 1.0},
        0.2 * np.sin(TURNS * 8.5 + 1.0),
    ),
    "quadratic_drag": ({"coefficient": 0.1}, -0.529),
    "sublinear_viscous": ({"coefficient": 0.1, "exponent": 0.5}, -0.1 * np.sqrt(2.3)),
}


@pytest.mark.parametrize("name", TORQUES)
def test_torques_resist_by_the_formula(name):
    values, expected = TORQUES[name]
    _, rates = plant_of(free().with_effect(name, values))
    assert rates(T, 0.0, 0.0, THETA, W)[2] == pytest.approx(-expected / J, rel=1e-7)


LEVELS = {
    "coulomb_asymmetry": ({"ratio": 0.2}, 0.8, 1.0),
    "viscous_asymmetry": ({"ratio": 0.2}, 1.0, 0.8),
    "position_dependent_friction": (
        {"ratio": 0.3, "harmonic": 2.0, "phase": 0.4},
        1.0 + 0.3 * np.sin(2.2),
        1.0,
    ),
    "thermal_drift": ({"ratio": -0.5, "time_constant": 1.7}, 0.5 + 0.5 / np.e, 0.5 + 0.5 / np.e),
    "friction_step": ({"ratio": 0.4, "time": 1.7}, 1.4, 1.0),
    "load_dependent_friction": ({"coefficient": 0.1}, 1.0 + 0.1 * 2.0 / 0.285, 1.0),
}


@pytest.mark.parametrize("name", LEVELS)
def test_levels_change_by_the_formula(name):
    """Coulomb friction sliding backwards under a load of 2 N m."""
    values, G, Gv = LEVELS[name]
    _, rates = plant_of(model_of("coulomb", J).with_effect(name, values))
    F = -G * 0.285 + Gv * 0.018 * W
    assert rates(T, 0.0, 2.0, THETA, W)[0] == pytest.approx(F, rel=1e-12)


def test_nothing_has_warmed_up_before_the_log_starts():
    drift = EFFECTS["thermal_drift"]
    assert drift(-1e6, ratio=0.5, time_constant=1.0) == (0.0,)


@given(st.floats(0.05, 0.95), st.floats(-100.0, 100.0))
def test_sublinear_friction_is_a_power_of_the_speed_and_smooth_at_rest(n, w):
    drag = EFFECTS["sublinear_viscous"]
    (d,) = drag(w, coefficient=0.3, exponent=n, eps=1e-4)
    assert d * w >= 0.0 and abs(d) <= 0.3 * abs(w) ** n
    if abs(w) > 0.01:
        assert d == pytest.approx(0.3 * abs(w) ** n * np.sign(w), rel=1e-4)
    slope = drag(1e-9, coefficient=0.3, exponent=n, eps=1e-4)[0] / 1e-9
    assert slope == pytest.approx(0.3 * 1e-4 ** (n - 1.0), rel=1e-6)


# The order in which effects act.


def test_load_is_d_gravity_and_a_constant_torque_but_no_other():
    model = model_of("coulomb", J).with_effect("load_dependent_friction", {"coefficient": 0.1})
    loads, spring = 0.4 * np.sin(THETA) - 0.3, 2.0 * (THETA - 0.6)
    model = model.with_effect("gravity", {"amplitude": 0.4, "phase": 0.0})
    model = model.with_effect("constant_torque", {"torque": -0.3})
    model = model.with_effect("return_spring", {"stiffness": 2.0, "rest": 0.6})
    model = model.with_effect("quadratic_drag", {"coefficient": 0.1})
    _, rates = plant_of(model)
    level = 0.285 + 0.1 * abs(0.2 + loads)
    F, _, dw, *_ = rates(T, 0.0, 0.2, THETA, W)
    assert F == pytest.approx(-level + 0.018 * W, rel=1e-12)
    resisting = 0.2 + loads + spring - 0.1 * W * W
    assert J * dw == pytest.approx(-F - resisting, rel=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_what_is_added_to_a_level_comes_on_top_of_what_multiplies_it(order):
    model = model_of("coulomb", J)
    for name in ("load_dependent_friction", "coulomb_asymmetry")[::order]:
        gain = EFFECTS[name].gain
        model = model.with_effect(name, {gain: 0.1})
    _, rates = plant_of(model)
    assert rates(T, 0.0, 2.0, THETA, 1.0)[0] == pytest.approx(1.1 * 0.285 + 0.2 + 0.018)


@pytest.mark.parametrize("order", [1, -1])
def test_input_effects_act_in_the_order_of_the_model(order):
    model = free()
    values = {"actuator_dead_zone": 0.1, "actuator_saturation": 0.5}
    for name in list(values)[::order]:
        model = model.with_effect(name, {EFFECTS[name].gain: values[name]})
    _, rates = plant_of(model)
    assert J * rates(T, 3.0, 0.0, 0.0, 0.0)[2] == pytest.approx(0.5 if order == 1 else 0.4)


def test_the_torque_constant_ripples():
    values = {"ratio": 0.2, "harmonic": 4.0, "phase": 0.3}
    _, rates = plant_of(free().with_effect("torque_constant_ripple", values))
    expected = 3.0 * (1.0 + 0.2 * np.sin(4.0 * THETA + 0.3))
    assert J * rates(T, 3.0, 0.0, THETA, W)[2] == pytest.approx(expected)


@pytest.mark.parametrize("order", [1, -1])
def test_the_amplifier_saturates_before_the_torque_constant_ripples(order):
    values = {
        "actuator_saturation": {"limit": 0.5},
        "torque_constant_ripple": {"ratio": 0.2, "harmonic": 4.0, "phase": 0.3},
    }
    model = free()
    for name in list(values)[::order]:
        model = model.with_effect(name, values[name])
    _, rates = plant_of(model)
    expected = 0.5 * (1.0 + 0.2 * np.sin(4.0 * THETA + 0.3))
    assert J * rates(T, 3.0, 0.0, THETA, 0.0)[2] == pytest.approx(expected)


# Effects that complete a friction law.


@given(st.integers(0, 1000), st.floats(1.0, 3.0), st.floats(0.1, 2.0), st.sampled_from([0, 1]))
def test_a_static_law_with_presliding_is_lugre(seed, excess, vs, static):
    law = ("coulomb", "stribeck")[static]
    level = {"Fc": 0.3, "Fv": 0.02} | ({"Fs": 0.3 * excess, "vs": vs} if static else {})
    bristles = {"sigma0": 200.0, "sigma1": 0.5}
    other = {"Fs": 0.3, "vs": 1.0} | level
    _, made = plant_of(model_of(law, J, **level).with_effect("presliding", bristles))
    _, lugre = plant_of(model_of("lugre", J, **bristles, **other))
    whole, _ = plant_of(model_of("lugre", J))
    args = arguments(whole, (30,), seed)
    ours, theirs = made(*args), lugre(*args)
    np.testing.assert_allclose(ours[2:], theirs[2:], rtol=1e-11, atol=1e-9)


@given(st.floats(-1.0, 1.0), st.floats(1.0, 3.0), st.floats(0.01, 2.0))
def test_coulomb_with_the_stribeck_effect_is_the_stribeck_law(w, excess, vs):
    more = {"Fs": 0.3 * excess, "vs": vs}
    _, made = plant_of(model_of("coulomb", J, Fc=0.3).with_effect("stribeck", more))
    _, law = plant_of(model_of("stribeck", J, Fc=0.3, **more))
    ours, theirs = made(T, 0.1, 0.0, 0.0, w), law(T, 0.1, 0.0, 0.0, w)
    np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14)


def test_shared_values_follow_the_plant_and_its_effects():
    """Friction that has stepped up by half carries bristles that are half as strong again."""
    bristles = {"sigma0": 200.0, "sigma1": 0.5}
    model = model_of("coulomb", J, Fc=0.3).with_effect("presliding", bristles)
    stepped = model.with_effect("friction_step", {"ratio": 0.5, "time": 0.0})
    _, made = plant_of(stepped)
    _, other = plant_of(model.with_values({"Fc": 0.45}))
    for seed in range(5):
        args = arguments(plant_of(model)[0], (10,), seed)
        np.testing.assert_allclose(made(*args), other(*args), rtol=1e-12, atol=1e-12)


def dwelling(tau, **values):
    """Drive, and where its state of rest stands."""
    made = {"ratio": 0.5, "time_constant": tau}
    plant = lg.plant(model_of("lugre", J, **values).with_effect("dwell_stiction", made))
    return plant, plant.state_labels.index("dwell_stiction_rest")


def test_stiction_grows_while_the_drive_rests_and_goes_when_it_slides():
    plant, state = dwelling(0.3)
    t = np.linspace(0.0, 1.0, 501)
    rest = run(plant, t, np.where(t < 0.6, 0.0, 1.0)).states[state]
    held = t < 0.6
    np.testing.assert_allclose(rest[held], 1.0 - np.exp(-t[held] / 0.3), rtol=1e-6, atol=1e-9)
    assert np.max(np.abs(rest[t > 0.65])) < 1e-3


@pytest.mark.parametrize("part, rests", [(0.0, True), (0.98, True), (1.06, False)])
def test_a_drive_rests_below_half_the_stribeck_speed(part, rests):
    rest, vs, own = 0.4, 0.02, {"ratio": 0.5, "time_constant": 0.3, "release": 1e-3}
    _, rate = EFFECTS["dwell_stiction"](-0.5 * vs * part, rest, vs=vs, **own)
    assert rate == pytest.approx((1.0 - rest) / 0.3 if rests else -rest / 1e-3)


@pytest.mark.parametrize("dwell", [0.05, 3.0])
def test_break_away_torque_after_a_rest(dwell):
    """A slow ramp breaks away at Fs (1 + a (1 - exp(-t_rest/tau)))."""
    plant, _ = dwelling(2.0, vs=0.2, Fv=0.0)
    t = np.append(0.0, dwell + np.linspace(0.0, 2.0, 501))
    u = np.maximum(0.3 * (t - dwell), 0.0)
    w = run(plant, t, u).outputs[1]
    broke = np.argmax(w > 0.2)
    assert broke > 0
    grown = 1.0 - np.exp(-t[broke] / 2.0)
    assert u[broke] == pytest.approx(0.335 * (1.0 + 0.5 * grown), rel=0.02)
