"""Effects against closed forms: torques, levels, lags, springs, gaps, their order, energy."""

import control as ct
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import lugrectl as lg
from lugrectl.blocks.effects import held_lagging
from lugrectl.blocks.friction import along, strokes

from ..cases.drives import EFFECTS, J, arguments, free, model_of, plant_of, run, states

TURNS = 2.0 * np.pi
T, THETA, W = 1.7, 0.9, -2.3
RIPPLE = {"ratio": 0.2, "harmonic": 4.0, "phase": 0.3}


def rates_of(name, **values):
    """The rates of a drive without friction with one effect."""
    return plant_of(free().with_effect(name, values))[1]


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
    moved = rates_of(name, **values)(T, 0.0, 0.0, THETA, W)[2]
    assert moved == pytest.approx(-expected / J, rel=1e-7)


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


@given(st.floats(0.05, 0.95), st.floats(-100.0, 100.0))
def test_sublinear_friction_is_a_power_of_the_speed_and_smooth_at_rest(n, w):
    drag = EFFECTS["sublinear_viscous"]
    (d,) = drag(w, coefficient=0.3, exponent=n, eps=1e-4)
    assert d * w >= 0.0 and abs(d) <= 0.3 * abs(w) ** n
    if abs(w) > 0.01:
        assert d == pytest.approx(0.3 * abs(w) ** n * np.sign(w), rel=1e-4)
    slope = drag(1e-9, coefficient=0.3, exponent=n, eps=1e-4)[0] / 1e-9
    assert slope == pytest.approx(0.3 * 1e-4 ** (n - 1.0), rel=1e-6)


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


ORDERS = {  # effects of the command in both orders, and the torque of a command of 3 N m
    "dead zone first": ({"actuator_dead_zone": 0.1, "actuator_saturation": 0.5}, 0.5),
    "limit first": ({"actuator_saturation": 0.5, "actuator_dead_zone": 0.1}, 0.4),
    "ripple": ({"torque_constant_ripple": 0.2}, 3.0 * (1.0 + 0.2 * np.sin(4.0 * THETA + 0.3))),
    **{  # the amplifier saturates before the torque constant ripples
        f"limit and ripple, {order}": (
            dict([("actuator_saturation", 0.5), ("torque_constant_ripple", 0.2)][::order]),
            0.5 * (1.0 + 0.2 * np.sin(4.0 * THETA + 0.3)),
        )
        for order in (1, -1)
    },
}


@pytest.mark.parametrize(("effects", "expected"), ORDERS.values(), ids=ORDERS)
def test_effects_on_the_command_act_in_the_order_of_the_model(effects, expected):
    model = free()
    for name, size in effects.items():
        own = RIPPLE if "ripple" in name else {EFFECTS[name].gain: size}
        model = model.with_effect(name, own)
    _, rates = plant_of(model)
    assert J * rates(T, 3.0, 0.0, THETA, 0.0)[2] == pytest.approx(expected)


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


def test_stiction_grows_while_the_drive_rests_and_goes_when_it_slides():
    made = {"ratio": 0.5, "time_constant": 0.3}
    plant = lg.plant(model_of("lugre", J).with_effect("dwell_stiction", made))
    state = plant.state_labels.index("dwell_stiction_rest")
    t = np.linspace(0.0, 1.0, 501)
    rest = run(plant, t, np.where(t < 0.6, 0.0, 1.0)).states[state]
    held = t < 0.6
    np.testing.assert_allclose(rest[held], 1.0 - np.exp(-t[held] / 0.3), rtol=1e-6, atol=1e-9)
    assert np.max(np.abs(rest[t > 0.65])) < 1e-3


@settings(max_examples=20)
@given(st.integers(0, 100), st.floats(0.05, 50.0))
def test_the_lag_of_a_held_torque_is_exact(seed, ratio):
    """Cell averages against the integral of the lag's own equation, v' from v in closed form."""
    u, dt = np.random.default_rng(seed).normal(size=8), 1e-3
    tau, v, means = ratio * dt, u[0], []
    for held in u:
        sol = solve_ivp(
            lambda t, y, held=held: [(held - y[0]) / tau, y[0]],
            (0.0, dt),
            [v, 0.0],
            "DOP853",
            rtol=1e-11,
            atol=1e-14,
        )
        v, area = sol.y[:, -1]
        means.append(area / dt)
    np.testing.assert_allclose(held_lagging(u, dt, tau), means, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(
    "name", [m.name for m in EFFECTS.values() if m.states and m.name != "dwell_stiction"]
)
def test_start_names_the_state_in_equilibrium(name):
    """All signals constant, the states where ``start`` puts them: nothing moves."""
    made = EFFECTS[name]
    signals = {
        "u": 0.7,
        "w": 0.0 if name == "presliding" else 2.0,
        "theta": 1.0,
    }
    x = [signals.get(k, 0.0) for k in made.start]
    values = made.defaults()
    values[made.gain] = 0.05
    result = made(*[signals[k] for k in made.inputs], *x, **values)
    assert not np.any(result[len(made.fresh) :])


def test_an_eccentric_encoder_keeps_w_the_rate_of_theta():
    values = {"amplitude": 0.2, "phase": 0.7}
    sensor = lg.sensor(free().with_effect("encoder_eccentricity", values))
    t = np.linspace(0.0, 2.0, 4001)
    theta, w = 3.0 * t + np.sin(2.0 * t), 3.0 + 2.0 * np.cos(2.0 * t)
    w_m, theta_m = np.array(
        [sensor.output(0.0, [], [a, b]) for a, b in zip(w, theta, strict=True)]
    ).T
    np.testing.assert_allclose(theta_m, theta + 0.2 * np.sin(theta + 0.7), rtol=1e-12)
    np.testing.assert_allclose(np.gradient(theta_m, t)[1:-1], w_m[1:-1], atol=1e-5)


@pytest.mark.parametrize("harmonic", [1.0, 2.0])
def test_pose_dependent_inertia_keeps_the_kinetic_energy(harmonic):
    values = {"ratio": 0.6, "harmonic": harmonic, "phase": 0.4}
    plant = lg.plant(free().with_effect("pose_dependent_inertia", values))
    t = np.linspace(0.0, 1.0, 201)
    theta, w, _ = run(plant, t, 0.0, states(plant, w=12.0)).outputs
    energy = (1.0 + 0.6 * np.cos(harmonic * theta + 0.4)) * w**2
    assert theta[-1] > TURNS and np.ptp(w) > 1.0
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)


@settings(max_examples=20)
@given(st.floats(0.1, 3.0), st.floats(1.0, 200.0))
def test_resonance_and_antiresonance_of_two_masses(share, stiffness):
    load = share * J
    values = {"load_inertia": load, "stiffness": stiffness, "damping": 0.0}
    plant = lg.plant(free().with_effect("elastic_coupling", values))
    whole = plant.linearize(np.zeros(4), [0.0, 0.0])
    linear = ct.ss(whole.A, whole.B[:, :1], whole.C[1:2], 0.0)
    poles = np.sort(np.abs(np.imag(linear.poles())))
    zeros = np.sort(np.abs(np.imag(linear.zeros())))
    assert poles[-1] == pytest.approx(np.sqrt(stiffness * (1 / J + 1 / load)), rel=1e-6)
    assert zeros[-1] == pytest.approx(np.sqrt(stiffness / load), rel=1e-6)


def test_a_load_slides_to_rest_in_the_gap_under_its_own_friction():
    """It slows by Fl/Jl and stays: the drive, which coasts on, feels nothing."""
    load, slowing = 0.7 * J, 4.0
    values = {"load_inertia": load, "gap": 10.0, "stiffness": 80.0, "damping": 0.0}
    plant = lg.plant(free().with_effect("backlash", values | {"load_friction": slowing * load}))
    t = np.linspace(0.0, 0.5, 101)
    start = states(plant, w=2.0, backlash_w_load=1.0)
    found = lg.simulate(plant, t, {"u": 0.0 * t}, x0=start)
    x = dict(zip(plant.state_labels, found.states, strict=True))
    np.testing.assert_allclose(x["backlash_w_load"], np.maximum(1.0 - slowing * t, 0.0), atol=1e-4)
    np.testing.assert_allclose(x["w"], 2.0, atol=1e-9)


def test_backlash_runs_free_through_half_the_gap_and_keeps_the_energy():
    load, gap, k, u = 0.7 * J, 0.04, 80.0, 0.05
    values = {"load_inertia": load, "gap": gap, "stiffness": k, "damping": 0.0}
    plant = lg.plant(free().with_effect("backlash", values))
    contact = np.sqrt(gap * J / u)
    t = np.linspace(0.0, 4.0 * contact, 401)
    found = run(plant, t, u)
    x = dict(zip(plant.state_labels, found.states, strict=True))
    alone = t < contact
    np.testing.assert_allclose(x["theta"][alone], 0.5 * u / J * t[alone] ** 2, rtol=1e-6, atol=1e-9)
    assert not np.any(x["backlash_w_load"][alone])
    assert x["backlash_w_load"][np.argmax(t > 1.05 * contact)] > 0.0
    stretch = np.maximum(np.abs(x["backlash_twist"]) - 0.5 * gap, 0.0)
    energy = 0.5 * (J * x["w"] ** 2 + load * x["backlash_w_load"] ** 2 + k * stretch**2)
    np.testing.assert_allclose(energy, u * x["theta"], rtol=1e-5, atol=1e-9)


def test_a_hard_stop_gives_back_what_it_takes():
    k, speed, side = 40.0, 3.0, -1.0
    values = {"position": side * 0.2, "stiffness": k, "side": side}
    plant = lg.plant(free().with_effect("hard_stop", values))
    t = np.linspace(0.0, 0.2, 2001)
    theta, w, _ = run(plant, t, 0.0, states(plant, w=side * speed)).outputs
    depth = side * theta - 0.2
    assert np.max(depth) == pytest.approx(speed * np.sqrt(J / k), rel=1e-4)
    assert w[-1] == pytest.approx(-side * speed, rel=1e-6)
    assert np.count_nonzero(depth > 0.0) * 1e-4 == pytest.approx(np.pi * np.sqrt(J / k), abs=2e-4)


def test_between_reversals_it_relaxes_over_the_path():
    dx = np.concatenate([np.full(400, 1e-3), np.zeros(5), np.full(400, -1e-3)])
    z = along(*strokes(dx), 0.05)
    turned = z[404]
    np.testing.assert_allclose(z[:400], 1.0 - np.exp(-np.arange(1, 401) * 0.02))
    np.testing.assert_allclose(z[405:], -1.0 + (1.0 + turned) * np.exp(-np.arange(1, 401) * 0.02))


def value(block, x, t=0.0, params=None):
    return float(block.output(t, [], np.atleast_1d(x), params=params)[0])


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12),
    st.floats(-3.0, 15.0),
    st.floats(0.1, 2.0),
)
def test_a_table_is_the_line_through_its_points(values, x, step):
    points = step * np.arange(len(values))
    block = lg.tabulated("theta", points, values)
    bends = np.abs(np.diff(np.r_[values[0], values, values[-1]], 2)).max()
    # corners are rounded over 2 % of the step; each adds at most width^2/(4 distance) elsewhere
    assert value(block, x) == pytest.approx(np.interp(x, points, values), abs=0.03 * bends + 1e-12)


@given(st.floats(-20.0, 20.0), st.integers(-3, 3))
@example(np.pi, -1)  # the place where an angle is wrapped
def test_a_periodic_table_repeats_every_turn(x, turns):
    points = np.array([-2.5, -1.0, 0.2, 1.5, 3.0])
    values = np.array([0.3, -0.2, 0.1, 0.4, -0.1])
    block = lg.tabulated("theta", points, values, periodic=True)
    assert value(block, x) == pytest.approx(value(block, x + 2 * np.pi * turns), abs=1e-9)
    expected = np.interp(x, points, values, period=2 * np.pi)
    assert value(block, x) == pytest.approx(expected, abs=0.02)


def test_two_rows_are_the_two_directions():
    block = lg.tabulated("theta", [0.0, 1.0, 2.0], [[0.1, 0.2, 0.2], [-0.3, -0.1, 0.0]])
    assert block.input_labels == ["theta", "w"]
    forward, back = (value(block, [0.5, w]) for w in (0.1, -0.1))
    assert forward == pytest.approx(0.15, abs=0.003) and back == pytest.approx(-0.2, abs=0.005)
    assert value(block, [0.5, 0.0]) == pytest.approx(0.5 * (forward + back))


def test_a_table_over_time_has_no_input_and_a_scale_switches_it_off():
    block = lg.tabulated("t", [0.0, 2.0], [0.0, 1.0], name="late")
    assert not block.input_labels and block.output_labels == ["d"]
    assert value(block, [], t=1.0) == pytest.approx(0.5, abs=1e-3)
    assert value(block, [], t=1.0, params={"late.scale": 0.0}) == 0.0
