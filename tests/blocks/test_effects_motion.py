"""Effects with states or on sensors against closed forms: lags, springs, gaps, stops, energy."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import lugrectl as lg
from lugrectl.blocks.effects.actuator import held_lagging

from ..cases.drives import EFFECTS, J, free, plant_of, run, states

TURNS = 2.0 * np.pi
T, THETA, W = 1.7, 0.9, -2.3

# Actuator and sensors.


def test_a_step_through_the_actuator_lag():
    block = EFFECTS["actuator_lag"].system(time_constant=0.05)
    t = np.linspace(0.0, 0.2, 101)
    out = run(block, t, 2.0).outputs
    np.testing.assert_allclose(out, 2.0 * (1.0 - np.exp(-t / 0.05)), atol=1e-7)


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


def test_the_delay_block_keeps_its_phase():
    """Within 1 degree of exp(-s T) up to w T = 1.7, as its docstring says, and of gain 1."""
    T = 0.01
    linear = EFFECTS["input_delay"].system(delay=T).linearize([0.0, 0.0], [0.0])
    for x in (0.1, 0.5, 1.0, 1.7):
        response = complex(linear(1j * x / T))
        assert abs(np.angle(response * np.exp(1j * x), deg=True)) < 1.0
        assert abs(response) == pytest.approx(1.0, abs=1e-4)


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


def test_a_lagging_sensor_trails_a_ramp_by_tau():
    sensor = lg.sensor(free().with_effect("velocity_sensor_lag", {"time_constant": 0.01}))
    t = np.linspace(0.0, 0.3, 301)
    w_m, theta_m = run(sensor, t, 5.0 * t).outputs
    np.testing.assert_allclose(w_m[100:], 5.0 * (t[100:] - 0.01), atol=1e-4)
    assert not np.any(theta_m)


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


def test_sensors_stand_one_behind_the_other():
    """A lag first: the eccentric encoder then scales the speed that lags."""
    ecc = {"amplitude": 0.2, "phase": 0.0}
    model = free().with_effect("velocity_sensor_lag", {"time_constant": 0.01})
    sensor = lg.sensor(model.with_effect("encoder_eccentricity", ecc))
    w_m, theta_m = sensor.output(0.0, [3.0], [7.0, 1.0])
    assert w_m == pytest.approx(3.0 * (1.0 + 0.2 * np.cos(1.0)))
    assert theta_m == pytest.approx(1.0 + 0.2 * np.sin(1.0))
    nothing = lg.sensor(free())
    assert np.array_equal(nothing.output(0.0, [], [7.0, 1.0]), [7.0, 1.0])


def test_a_sensor_without_a_value_is_refused():
    model = free().with_effect("encoder_eccentricity")
    with pytest.raises(lg.InputError, match="encoder_eccentricity.amplitude"):
        lg.sensor(model)
    assert lg.plant(model).ninputs == 2  # the plant does not need it


# Inertia and what hangs on the shaft.


@pytest.mark.parametrize("harmonic", [1.0, 2.0])
def test_pose_dependent_inertia_keeps_the_kinetic_energy(harmonic):
    values = {"ratio": 0.6, "harmonic": harmonic, "phase": 0.4}
    plant = lg.plant(free().with_effect("pose_dependent_inertia", values))
    t = np.linspace(0.0, 3.0, 601)
    theta, w, _ = run(plant, t, 0.0, states(plant, w=4.0)).outputs
    energy = (1.0 + 0.6 * np.cos(harmonic * theta + 0.4)) * w**2
    assert theta[-1] > TURNS and np.ptp(w) > 1.0
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)


def test_pose_dependent_inertia_grows_with_the_payload():
    """The energy is kept after a step of the inertia too, whichever the model names first."""
    pose = {"ratio": 0.6, "harmonic": 1.0, "phase": 0.4}
    step = {"ratio": 0.5, "time": 0.0}
    one = free().with_effect("pose_dependent_inertia", pose).with_effect("inertia_step", step)
    _, made = plant_of(one)
    _, other = plant_of(free(1.5 * J).with_effect("pose_dependent_inertia", pose))
    assert made(T, 0.3, 0.1, THETA, W)[2] == pytest.approx(other(T, 0.3, 0.1, THETA, W)[2])


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


@pytest.mark.parametrize("name", ["elastic_coupling", "backlash"])
def test_slow_motion_carries_the_load_along(name):
    """Both masses accelerate as one, whatever theta was at the start."""
    values = {"load_inertia": J, "stiffness": 50.0, "damping": 0.5, "gap": 0.0}
    values = {k: v for k, v in values.items() if k in EFFECTS[name].parameters}
    plant = lg.plant(free().with_effect(name, values))
    t = np.linspace(0.0, 1.0, 101)
    start = states(plant, theta=100.0)
    w = run(plant, t, 0.1, start).outputs[1]
    assert w[-1] == pytest.approx(0.1 / (2 * J), rel=1e-3)
    still = states(plant, theta=5.0, w=3.0, **{f"{name}_w_load": 3.0})
    assert not np.any(plant.dynamics(0.0, still, [0.0, 0.0])[1:])


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


def test_the_friction_of_a_load_is_none_unless_it_is_given():
    values = {"load_inertia": J, "gap": 0.01, "stiffness": 80.0, "damping": 0.1}
    without = free().with_effect("backlash", values)
    assert without.values()["backlash.load_friction"] == 0.0
    assert "backlash.load_friction" in without.held()
    given = free().with_effect("backlash", values | {"load_friction": 0.1})
    assert "backlash.load_friction" not in given.held()
    entry = {"name": "backlash", "gap": 0.01}
    declared = lg.Model.of(J=J, friction="coulomb", effects=[entry])
    assert "backlash.load_friction" in declared.held()
    assert declared.values()["backlash.stiffness"] is None


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


def test_backlash_pushes_from_both_flanks():
    made, values = EFFECTS["backlash"], {"load_inertia": 1.0, "gap": 0.4, "stiffness": 10.0}
    for twist, torque in ((0.5, 3.0), (0.1, 0.0), (-0.1, 0.0), (-0.5, -3.0)):
        assert made(0.0, twist, 0.0, damping=0.2, **values)[0] == pytest.approx(torque)
        assert made(1.0, twist, 0.0, damping=0.2, **values)[0] == pytest.approx(
            torque + (0.2 if torque else 0.0)
        )


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_hard_stop_gives_back_what_it_takes(side):
    k, speed = 40.0, 3.0
    values = {"position": side * 0.2, "stiffness": k, "side": side}
    plant = lg.plant(free().with_effect("hard_stop", values))
    t = np.linspace(0.0, 0.2, 2001)
    theta, w, _ = run(plant, t, 0.0, states(plant, w=side * speed)).outputs
    depth = side * theta - 0.2
    assert np.max(depth) == pytest.approx(speed * np.sqrt(J / k), rel=1e-4)
    assert w[-1] == pytest.approx(-side * speed, rel=1e-6)
    assert np.count_nonzero(depth > 0.0) * 1e-4 == pytest.approx(np.pi * np.sqrt(J / k), abs=2e-4)


def test_inertia_steps():
    _, rates = plant_of(free().with_effect("inertia_step", {"ratio": 0.6, "time": 1.0}))
    assert rates(0.99, 0.3, 0.0, 0.0, 0.0)[2] == pytest.approx(0.3 / J)
    assert rates(1.0, 0.3, 0.0, 0.0, 0.0)[2] == pytest.approx(0.3 / (1.6 * J))
