"""The contract that every effect keeps, whoever wrote it."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict, read_model, write_model
from lugrectl.blocks.plant import assemble
from lugrectl.engine.runtime import adaptive_run
from lugrectl.engine.runtime.backend import compiler

from ..cases.drives import EFFECTS, LAWS, arguments, law_for, model_of, own, plant_of, strong


def each(holds=lambda made: True):
    """Every effect of which ``holds`` is true."""
    kept = {name: made for name, made in EFFECTS.items() if holds(made)}
    return pytest.mark.parametrize("made", [pytest.param(m, id=name) for name, m in kept.items()])


every_effect = each()
every_law = pytest.mark.parametrize("law", LAWS)
CONTRACT = """constant_torque gravity torque_ripple position_dependent_friction coulomb_asymmetry
    viscous_asymmetry quadratic_drag thermal_drift load_dependent_friction dwell_stiction stribeck
    presliding input_delay actuator_lag actuator_saturation actuator_dead_zone return_spring
    hard_stop elastic_coupling backlash inertia_step friction_step periodic_disturbance
    velocity_sensor_lag encoder_eccentricity torque_constant_ripple sublinear_viscous
    pose_dependent_inertia"""


def with_effect(made, values, law=None):
    model = model_of(law or law_for(made))
    return model, model.with_effect(made.name, own(made, values))


def test_the_catalogue_is_whole():
    assert set(EFFECTS) == set(CONTRACT.split())


@every_effect
def test_declaration(made):
    levels = {"J", *(key for law in LAWS.values() for key in law.parameters)}
    plain = {act.removeprefix("+") for act in made.acts}
    assert made.acts and plain <= levels | {"torque", "input", "sensor"}
    assert len(made.fresh) in (1, len(made.acts)) or made.acts == ("sensor",)
    if made.acts == ("sensor",):
        assert made.inputs == ("w", "theta") and made.fresh == ("w_m", "theta_m")
    gain = made.parameters[made.gain]
    assert gain.low <= gain.neutral <= gain.high and gain.neutral in (0.0, np.inf)
    assert gain.value == gain.neutral
    assert len(made.start) == len(made.states) and set(made.start) <= {"0", *made.inputs}
    assert not made.load or made.acts == ("torque",)


@every_effect
def test_what_is_said_about_it(made):
    assert made.experiment and not made.experiment.endswith(".")
    assert made.confused and set(made.confused) <= set(EFFECTS) - {made.name}
    assert "In a log:" in " ".join(made.doc.split())


@every_effect
def test_amplitudes_are_positive_and_phases_within_a_turn(made):
    for key, p in made.parameters.items():
        if key == "amplitude":
            assert p.low == 0.0
        assert p.angle == (key == "phase")
        if p.angle:
            assert (p.low, p.high) == (-np.pi, np.pi) and p.span == (0.0, np.pi / 2)


@every_law
@every_effect
def test_at_its_neutral_value_it_changes_nothing(made, law):
    """Same rates at random points, and its own states stay at rest or do not matter."""
    neutral = strong(made) | {made.gain: made.parameters[made.gain].neutral}
    bare_model, model = with_effect(made, neutral, law)
    _, bare = plant_of(bare_model, sensed=True)
    whole, rates = plant_of(model, sensed=True)
    n = 5 + len(LAWS[law].states)  # F, w_m, theta_m and the rates of theta, w, friction
    for seed in range(2):
        args = arguments(assemble(bare_model, sensed=True), (20,), seed)
        extra = [np.zeros(20)] * (len(whole.states) - (n - 3))
        for _ in range(5):
            step = rates(*args, *extra)
            for with_it, without in zip(step[:n], bare(*args), strict=True):
                np.testing.assert_array_equal(with_it, without)
            extra = [x + 1e-3 * rate for x, rate in zip(extra, step[n:], strict=True)]


@every_effect
def test_with_strength_it_changes_the_plant(made):
    bare_model, model = with_effect(made, strong(made))
    _, bare = plant_of(bare_model, sensed=True)
    whole, rates = plant_of(model, sensed=True)
    args = arguments(whole, (20,))
    args[4] *= 0.005  # w, where stiction counts
    count = len(arguments(assemble(bare_model, sensed=True), ()))
    without, with_it = bare(*args[:count]), rates(*args)[: len(bare(*args[:count]))]
    changed = [not np.array_equal(a, b) for a, b in zip(without, with_it, strict=True)]
    moved = 4  # after F, w_m, theta_m, dtheta/dt
    assert any(changed[1:3]) if made.acts == ("sensor",) else changed[moved]


@each(lambda made: set(made.acts) <= {"torque", "input", "sensor"})  # the others have no signal
def test_the_block_in_a_loop_is_the_effect_inside_the_plant(made):
    """The rates of the wired blocks and of the one plant at the same point."""
    values = strong(made)
    bare, model = with_effect(made, values)
    shared = {k: bare.values()[k] for k in made.parameters if k not in made.own}
    block = lg.effect(made.name, **values | shared, name="effect")
    wired, one = _wired(made, block, lg.plant(bare)), _one(made, model)
    x, u = np.random.default_rng(3).normal(size=(2, wired.nstates))
    x[2] *= 1e-3 if law_for(made) == "lugre" else 1.0
    u = u[: wired.ninputs]
    np.testing.assert_allclose(wired.dynamics(1.0, x, u), one.dynamics(1.0, x, u), rtol=1e-12)
    np.testing.assert_allclose(wired.output(1.0, x, u), one.output(1.0, x, u), rtol=1e-12)


def _wired(made, block, plant):
    if made.acts == ("input",):
        block = lg.effect(made.name, name="effect", outputs="u", inputs=_fed(made), **_of(block))
    parts = [plant, block]
    outputs = ["w_m", "theta_m"] if made.acts == ("sensor",) else ["theta", "w", "F"]
    inputs = ["v"] if made.acts == ("input",) else ["u"]
    wiring = {"inputs": inputs, "outputs": outputs, "params": {}, "check_unused": False}
    return ct.interconnect(parts, **wiring)


def _fed(made):
    return ["v" if name == "u" else name for name in made.inputs]


def _of(block):
    return {k.split(".", 1)[1]: v for k, v in block.params.items()}


def _one(made, model):
    plant = lg.plant(model)
    if made.acts != ("sensor",):
        return ct.interconnect(
            [plant], inputs=["u"], outputs=["theta", "w", "F"], params={}, check_unused=False
        )
    return ct.interconnect(
        [plant, lg.sensor(model)], inputs=["u"], outputs=["w_m", "theta_m"], params={},
        check_unused=False,
    )  # fmt: skip


@each(lambda made: "torque" in made.acts and not made.states)
def test_along_a_log_it_is_the_effect_inside_the_plant(made):
    """A stateless torque, on whole arrays, is what the plant's torque balance lacks."""
    values = strong(made)
    bare_model, model = with_effect(made, values)
    _, bare = plant_of(bare_model)
    whole, rates = plant_of(model)
    args = arguments(whole, (50,))
    signals = dict(zip(("t", *whole.inputs, *whole.states), args, strict=True))
    names = (["t"] if made.timed else []) + list(made.inputs)
    values |= {k: model.values()[k] for k in made.parameters if k not in made.own}
    deeds = dict(made.deeds(made(*[signals[k] for k in names], **values)))
    J = 0.0022 * (1.0 + deeds.get("J", 0.0))
    missing = 0.0022 * bare(*args)[2] - J * rates(*args)[2]
    np.testing.assert_allclose(deeds["torque"], missing, rtol=1e-9, atol=1e-12)


def _a_delay_shifts_the_torque(bare, model, t, torque):
    late = model.values()["input_delay.delay"]
    grid = np.unique(np.concatenate([t, t[t + late < t[-1]] + late]))
    shifted = np.where(grid < late, 0.0, np.interp(grid - late, t, torque))
    ours = lg.simulate(lg.plant(model), t, np.array([torque, 0.0 * t]), rtol=1e-7).states[:3]
    other = lg.simulate(lg.plant(bare), grid, np.array([shifted, 0.0 * grid]), rtol=1e-7).states[:3]
    other = other[:, np.searchsorted(grid, t)]
    assert np.max(np.abs(ours - other) / np.max(np.abs(other), axis=1, keepdims=True)) < 1e-5


@every_effect
def test_the_engine_follows_it(made, monkeypatch):
    """lg.simulate against python-control, with a torque that moves, rests and reverses."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)
    values = strong(made) | ({"sigma0": 90.0} if made.name == "presliding" else {})
    bare, model = with_effect(made, values)
    if "harmonic" in made.own:
        model = model.with_values({f"{made.name}.harmonic": 3.0})
    system = _one(made, model) if made.acts == ("sensor",) else lg.plant(model)
    t = np.linspace(0.0, 0.25, 51)
    swing = np.sin(2.0 * np.pi * 5.0 * t)
    torque = 1.5 * np.sign(swing) * np.maximum(np.abs(swing) - 0.5, 0.0)
    if made.name == "input_delay":  # exact there, Pade's in python-control
        return _a_delay_shifts_the_torque(bare, model, t, torque)
    u = torque if system.ninputs == 1 else np.array([torque, 0.05 * np.cos(t)])
    ours = lg.simulate(system, t, u, rtol=1e-7)
    options = {"rtol": 1e-8, "atol": 1e-11, "max_step": 2e-3}  # or it passes over a torque
    theirs = ct.input_output_response(
        system, t, u, solve_ivp_method="LSODA", solve_ivp_kwargs=options
    )
    size = np.max(np.abs(theirs.states), axis=1, keepdims=True)
    assert np.max(np.abs(ours.states - theirs.states) / np.maximum(size, 1e-9)) < 2e-4


@pytest.mark.parametrize(
    "law, compiled",
    [("coulomb", False), ("lugre", False), pytest.param("lugre", True, marks=pytest.mark.slow)],
)
def test_all_effects_at_their_neutral_value_leave_a_simulation_alone(law, compiled, monkeypatch):
    """With and without machine code: no division by a lag of 0, no infinite stiffness."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: compiler() if compiled else None)
    bare = model = model_of(law)
    for made in EFFECTS.values():
        neutral = strong(made) | {made.gain: made.parameters[made.gain].neutral}
        model = model.with_effect(made.name, own(made, neutral))
    t = np.linspace(0.0, 0.1, 21)
    u = np.array([0.9 * np.sin(60.0 * t), 0.0 * t])
    ours, plain = (lg.simulate(lg.plant(m), t, u).outputs for m in (model, bare))
    np.testing.assert_allclose(ours, plain, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("made", [m for m in EFFECTS.values() if m.exact])
def test_the_exact_form_at_its_neutral_value_changes_nothing(made):
    u = np.random.default_rng(0).normal(size=50)
    neutral = made.defaults() | {made.gain: made.parameters[made.gain].neutral}
    np.testing.assert_array_equal(made.exact(u, 1e-3, **neutral), u)


@every_law
def test_all_effects_at_once(law):
    model = model_of(law)
    for made in EFFECTS.values():
        model = model.with_effect(made.name, own(made, strong(made)))
    whole, rates = plant_of(model, sensed=True)
    assert whole.inputs == ("u", "d")
    assert whole.outputs == ("theta", "w", "F", "w_m", "theta_m")
    args = arguments(whole, (6, 2))
    single = rates(*[float(a[4, 1]) for a in args])
    for of_batch, number in zip(rates(*args), single, strict=True):
        assert np.shape(of_batch) == (6, 2)
        np.testing.assert_allclose(number, of_batch[4, 1], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("values", [strong, lambda made: made.defaults()], ids=["set", "default"])
def test_a_model_file_keeps_every_effect(tmp_path, values):
    model = model_of("coulomb")
    for made in EFFECTS.values():
        model = model.with_effect(made.name, own(made, values(made)))
    write_model(model, tmp_path / "model.toml")
    assert read_model(tmp_path / "model.toml") == model
    assert None not in model.values().values()


@every_effect
def test_borrowed_values_are_nowhere_declared(made):
    _, model = with_effect(made, strong(made))
    shared = {f"{made.name}.{k}" for k in made.parameters if k not in made.own}
    assert not shared & (set(model.values()) | set(model.declarations()))
    for key in shared:
        text = {"name": made.name, key.split(".")[1]: 1.0}
        with pytest.raises(lg.InputError, match="unknown key"):
            model_from_dict({"effects": [text]}, "here")
