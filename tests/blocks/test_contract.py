"""The contract that every registered block keeps, whoever wrote it: laws, effects, observers,
controllers, and the forms that a law may have."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks import declaration
from lugrectl.blocks.block import REGISTRY, members, unit_for
from lugrectl.blocks.plant import assemble
from lugrectl.engine import adaptive_run

from ..cases import laws
from ..cases.drives import EFFECTS, LAWS, arguments, law_for, model_of, own, plant_of, strong
from ..cases.wired import joined, simulate

FORMS = {case: laws.model_of(case).friction.block for case, (_, own) in laws.CASES.items() if own}
BLOCKS = {f"{kind}-{name}": made for (kind, name), made in REGISTRY.items()} | FORMS
every_block = pytest.mark.parametrize("made", BLOCKS.values(), ids=BLOCKS)
LEVELS = (  # signals that are the same for both directions of a drive
    "zeta excess ahat scale slip lost Jhat Fvhat Fchat S0 S1 T".split()
)


def each(kind, holds=lambda made: True):
    """Every block of a kind of which ``holds`` is true."""
    kept = {name: made for name, made in members(kind).items() if holds(made)}
    return pytest.mark.parametrize("made", kept.values(), ids=kept)


every_effect = each("effect")


@every_block
def test_a_declaration_names_its_signals_equation_units_and_bounds(made):
    names = (made.name, *made.inputs, *made.outputs, *made.states, *made.parameters)
    assert all(name.isidentifier() for name in names)
    assert len(set(made.inputs + made.states)) == len(made.inputs + made.states)
    assert made.equation[-1] in ".," and any(mark in made.equation for mark in "=(+")
    for key, p in made.parameters.items():
        linear = unit_for(p.unit, "linear")
        assert p.unit and "N m" not in linear and linear != "rad", key
    made.check(made.defaults())
    declaration.check(made, [key for law in LAWS.values() for key in law.parameters])


@every_block
def test_one_text_for_numbers_arrays_batches_and_logs(made):
    sets, batch = [strong(made, seed) for seed in range(3)], arguments(made, (7, 3))
    before = [a.copy() for a in batch]
    values = {k: np.array([own[k] for own in sets]) for k in made.parameters}  # as in a sweep
    whole = made(*batch, **values)
    assert all(np.array_equal(a, b) for a, b in zip(batch, before, strict=True))
    assert len(whole) == len(made.fresh) + len(made.states)
    assert set(made.fresh) == set(made.outputs) - set(made.states)
    for i, j in ((0, 0), (3, 1), (6, 2)):
        column = made(*[a[:, j] for a in batch], **sets[j])
        single = made(*[float(a[i, j]) for a in batch], **sets[j])
        for of_batch, of_log, number in zip(whole, column, single, strict=True):
            assert np.shape(of_batch) == (7, 3)
            assert np.shape(of_log) == (7,) and np.shape(number) == ()
            np.testing.assert_allclose(of_log, of_batch[:, j], rtol=1e-12, atol=1e-14)
            np.testing.assert_allclose(number, of_batch[i, j], rtol=1e-12, atol=1e-14)


@every_block
def test_a_system_says_what_the_function_says(made):
    values = strong(made)
    inputs = [f"in{i}" for i in range(len(made.inputs))]
    outs = [f"out{i}" for i in range(len(made.outputs))]
    plain, system = made.system(), made.system("some", inputs, outs, **values)
    assert isinstance(system, ct.NonlinearIOSystem)
    assert set(system.params) == {f"some.{key}" for key in made.parameters}
    assert (plain.input_labels, plain.output_labels) == ([*made.inputs], [*made.outputs])
    assert (system.input_labels, system.output_labels) == (inputs, outs)
    assert (system.state_labels or []) == list(made.states)
    args = [float(a) for a in arguments(made, ())]
    t, rest = (args[0], args[1:]) if made.timed else (0.0, args)
    u, x = rest[: len(made.inputs)], rest[len(made.inputs) :]
    expected = made(*args, **values)
    known = dict(zip(made.states, x, strict=True)) | dict(zip(made.fresh, expected, strict=False))
    assert np.array_equal(system.output(t, x, u), [known[o] for o in made.outputs])
    assert np.isfinite(plain.output(0.0, 0.0 * np.array(x), 0.0 * np.array(u))).all()
    if made.states:
        assert np.array_equal(system.dynamics(t, x, u), expected[len(made.fresh) :])
        assert np.isfinite(plain.dynamics(0.0, 0.0 * np.array(x), 0.0 * np.array(u))).all()
    with pytest.raises(lg.InputError):
        made.system(outputs=[*outs, "one_more"])


@every_block
def test_unknown_and_impossible_values_are_refused(made):
    with pytest.raises(lg.InputError, match="no parameter 'nonsense'"):
        made.check({"nonsense": 1.0})
    for key, p in made.parameters.items():
        for wrong in (float("nan"), *([p.low - 1.0] if np.isfinite(p.low) else [])):
            with pytest.raises(lg.InputError, match=key):
                made.check({key: wrong})
        if p.choices:
            with pytest.raises(lg.InputError, match=f"{key} = 0.5 must be -1 or 1"):
                made.check({key: 0.5})


def mirrored(made, args, values):
    """Outputs and rates of a block, and those of the mirrored drive, mirrored back."""
    level = {*LEVELS} - ({"excess"} & {*made.inputs, *made.outputs})  # of a torque there
    signals = zip((*made.inputs, *made.states), args, strict=True)
    turned = [a if k in level else -a for k, a in signals]
    results = zip((*made.fresh, *made.states), made(*turned, **values), strict=True)
    turned = [b if k in level else -np.asarray(b) for k, b in results]
    return zip(made(*args, **values), turned, strict=True)


@pytest.mark.parametrize(
    "made", [pytest.param(m, id=k) for k, m in BLOCKS.items() if m.kind not in ("effect", "plant")]
)
def test_laws_observers_and_controllers_are_odd(made):
    """Signals change sign with the drive's direction; levels and scales do not."""
    assert made.kind != "observer" or made.outputs[0] == "Fhat"
    for seed in range(3):
        for one, other in mirrored(made, arguments(made, (50,), seed), strong(made, seed)):
            np.testing.assert_array_equal(one, other)


CURVED = ("adaptive_slotine_li", "dual_observer_control", "backstepping_smc")
CURVED += ("coulomb_predictor", "coulomb_compensation")


@each("observer", lambda made: {"w", "theta"} & set(made.inputs))
@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop])
def test_ready_loops_take_an_observer_by_name(make, made):
    short = made.name.removesuffix("_observer")
    loop = make(lg.table1(), short)
    with_s = make is lg.position_loop and "s" in made.inputs
    assert loop.input_labels == ["r", *["dr"] * with_s]
    part = next(one for one in loop.syslist if one.name == made.name)
    for key in set(made.parameters) - {*lg.Model.of(lg.table1()).values()}:
        assert part.params[f"{made.name}.{key}"] == made.parameters[key].value
    ahead = [
        make(lg.table1(), short, prefilter=x, feedforward=True, load=True) for x in (False, True)
    ]
    for one in (loop, *ahead):
        r = np.full(one.ninputs, 0.1)
        assert one.output_labels == ["theta", "w", "F", "Fhat", "u", "e"]
        assert np.isfinite(one.dynamics(0.0, np.full(one.nstates, 1e-3), r)).all()


def with_effect(made, values, law=None):
    model = model_of(law or law_for(made))
    return model, model.with_effect(made.name, own(made, values))


def with_all(law, values):
    """A model with every effect of the catalogue."""
    model = model_of(law)
    for made in EFFECTS.values():
        model = model.with_effect(made.name, own(made, values(made)))
    return model


def neutral(made):
    """Values at which an effect changes nothing."""
    return strong(made) | {made.gain: made.parameters[made.gain].neutral}


@every_effect
def test_an_effect_says_what_it_is_confused_with_and_how_to_tell(made):
    gain = made.parameters[made.gain]
    assert made.acts and gain.neutral in (0.0, np.inf) and gain.value == gain.neutral
    assert made.experiment and not made.experiment.endswith(".")
    assert made.confused and set(made.confused) <= set(EFFECTS) - {made.name}
    assert "In a log:" in " ".join(made.doc.split())
    assert not made.load or made.acts == ("torque",)
    for key, p in made.parameters.items():
        assert key != "amplitude" or p.low == 0.0
        assert p.angle == (key == "phase")
        assert not p.angle or (p.low, p.high, p.span) == (-np.pi, np.pi, (0.0, np.pi / 2))
    assert declaration.true_spans(made) == dict(made.parameters)


@pytest.mark.parametrize("law", ["coulomb", "maxwell_slip"])
@every_effect
def test_at_its_neutral_value_it_changes_nothing(made, law):
    """Same rates at random points, and its own states stay at rest or do not matter."""
    bare_model, model = with_effect(made, neutral(made), law)
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


def wired(parts, made, command="u"):
    sensed = made.acts == ("sensor",)
    outputs = ["w_m", "theta_m"] if sensed else ["theta", "w", "F"]
    return joined(parts, [command], outputs)


def inside(made, model):
    """The plant with the effect in it, and its sensor where it acts on that."""
    sensor = [lg.sensor(model)] if made.acts == ("sensor",) else []
    return wired([lg.plant(model), *sensor], made)


@each("effect", lambda made: set(made.acts) <= {"torque", "input", "sensor"})
def test_the_block_in_a_loop_is_the_effect_inside_the_plant(made):
    """The rates of the wired blocks and of the one plant at the same point."""
    values = strong(made)
    bare, model = with_effect(made, values)
    shared = {k: bare.values()[k] for k in made.parameters if k not in made.own}
    command = "v" if made.acts == ("input",) else "u"
    fed = [command if name == "u" else name for name in made.inputs]
    block = lg.effect(made.name, **values | shared, name="effect", inputs=fed)
    outside, one = wired([lg.plant(bare), block], made, command), inside(made, model)
    x, u = np.random.default_rng(3).normal(size=(2, outside.nstates))
    x[2] *= 1e-3 if law_for(made) == "lugre" else 1.0
    u = u[: outside.ninputs]
    np.testing.assert_allclose(outside.dynamics(1.0, x, u), one.dynamics(1.0, x, u), rtol=1e-12)
    np.testing.assert_allclose(outside.output(1.0, x, u), one.output(1.0, x, u), rtol=1e-12)


TOGETHER = {  # effects that one drive has
    "coulomb": "stribeck constant_torque return_spring coulomb_asymmetry quadratic_drag hard_stop "
    "load_dependent_friction friction_step",
    "stribeck": "presliding gravity torque_ripple viscous_asymmetry inertia_step "
    "periodic_disturbance actuator_dead_zone",
    "lugre": "elastic_coupling dwell_stiction thermal_drift position_dependent_friction "
    "actuator_lag actuator_saturation torque_constant_ripple sublinear_viscous",
    "viscous": "backlash pose_dependent_inertia velocity_sensor_lag encoder_eccentricity",
}


@pytest.mark.cases
@pytest.mark.parametrize("law", TOGETHER)
def test_the_engine_follows_them(law, monkeypatch):
    """lg.simulate against python-control, with a torque that moves, rests and reverses."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)
    assert {*" ".join(TOGETHER.values()).split(), "input_delay"} == set(EFFECTS)
    model = model_of(law)
    for name in TOGETHER[law].split():
        values = own(EFFECTS[name], strong(EFFECTS[name]))
        values |= {k: v for k, v in (("sigma0", 90.0), ("harmonic", 3.0)) if k in values}
        model = model.with_effect(name, values)
    system = joined([lg.plant(model), lg.sensor(model)], ["u", "d"], ["theta", "w_m", "theta_m"])
    t = np.linspace(0.0, 0.065, 14)
    swing = np.sin(20.0 * np.pi * t)
    torque = 1.5 * np.sign(swing) * np.maximum(np.abs(swing) - 0.5, 0.0)
    u = np.array([torque, 0.05 * np.cos(t)])
    ours = lg.simulate(system, t, u, rtol=1e-7)
    theirs = simulate(system, t, u, rtol=1e-7, atol=1e-10, max_step=2e-3)  # or it misses a torque
    size = np.max(np.abs(theirs.states), axis=1, keepdims=True)
    assert np.max(np.abs(ours.states - theirs.states) / np.maximum(size, 1e-9)) < 2e-4


def test_a_delay_shifts_the_torque(monkeypatch):
    """Exact in lg.simulate; in python-control it is Pade's form."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)
    late, t = 0.012, np.linspace(0.0, 0.1, 21)
    bare, torque = model_of("lugre"), 1.5 * np.sin(20.0 * np.pi * t)
    model = bare.with_effect("input_delay", {"delay": late})
    grid = np.unique(np.concatenate([t, t[t + late < t[-1]] + late]))
    shifted = np.where(grid < late, 0.0, np.interp(grid - late, t, torque))
    ours = lg.simulate(lg.plant(model), t, np.array([torque, 0.0 * t]), rtol=1e-7).states[:3]
    other = lg.simulate(lg.plant(bare), grid, np.array([shifted, 0.0 * grid]), rtol=1e-7).states[:3]
    other = other[:, np.searchsorted(grid, t)]
    assert np.max(np.abs(ours - other) / np.max(np.abs(other), axis=1, keepdims=True)) < 1e-5


@pytest.mark.parametrize("law", ["coulomb", "lugre"])
def test_all_effects_at_their_neutral_value_leave_a_simulation_alone(law, monkeypatch):
    """No division by a lag of 0, no infinite stiffness."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)
    t = np.linspace(0.0, 0.1, 21)
    u = np.array([0.9 * np.sin(60.0 * t), 0.0 * t])
    models = with_all(law, neutral), model_of(law)
    ours, plain = (lg.simulate(lg.plant(m), t, u).outputs for m in models)
    np.testing.assert_allclose(ours, plain, rtol=1e-4, atol=1e-6)
