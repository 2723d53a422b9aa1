"""The contract that every registered block keeps, whoever wrote it."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lugrectl import loops as _loops  # noqa: F401  fills the registry
from lugrectl.blocks.plant import assemble
from lugrectl.errors import InputError
from lugrectl.model import model_from_dict
from lugrectl.spec import REGISTRY, block, members, unit_for

KINDS = {"friction", "plant", "observer", "controller", "effect"}
BLOCKS = [pytest.param(made, id=made.name) for made in REGISTRY.values()]
EFFECTS = [pytest.param(made, id=made.name) for made in members("effect").values()]
LAWS = list(members("friction"))
every_block = pytest.mark.parametrize("made", BLOCKS)
every_effect = pytest.mark.parametrize("made", EFFECTS)
every_law = pytest.mark.parametrize("law", LAWS)


def arguments(made, shape, seed=0):
    """Random signals and states; z-like states stay small, as the bristles do."""
    rng = np.random.default_rng(seed)
    time = [rng.uniform(0.0, 5.0, shape)] if made.timed else []
    size = {s: 1e-3 if s.startswith("z") else 1.0 for s in made.inputs + made.states}
    return time + [size[s] * rng.normal(size=shape) for s in made.inputs + made.states]


def strong(made, seed=0):
    """Parameter values away from the defaults, inside their bounds."""
    rng = np.random.default_rng(seed)
    values = {}
    for key, p in made.parameters.items():
        low, high = max(p.low, p.value - 0.5 * abs(p.value) - 0.1), p.value * 1.5 + 0.1
        values[key] = rng.uniform(low, min(p.high, max(high, low)))
    return values


def model_of(law):
    """A model with the law's default parameters and nothing else."""
    friction = {k: p.value for k, p in members("friction")[law].parameters.items() if p.fitted}
    return model_from_dict({"plant": {"J": 0.0022}, "friction": {"model": law, **friction}}, law)


def plant_of(model):
    """The plant's pure function with all values filled in: arguments t, u, d, states."""
    made = assemble(model)
    values = model.values()

    def rates(*signals):
        return made(*signals, **values)

    return made, rates


@every_block
def test_declaration(made):
    assert made.kind in KINDS
    names = (made.name, *made.inputs, *made.outputs, *made.states, *made.parameters)
    assert all(name.isidentifier() for name in names)
    assert made.outputs and len(set(made.outputs)) == len(made.outputs)
    assert len(set(made.inputs + made.states)) == len(made.inputs + made.states)


@every_block
def test_docstring_starts_with_the_equation(made):
    assert made.equation.endswith(".") or made.equation.endswith(",")
    assert any(mark in made.equation for mark in "=(+"), made.equation


@every_block
def test_parameters_have_a_unit_and_a_default_inside_their_bounds(made):
    for key, p in made.parameters.items():
        assert p.unit, key
        assert p.low <= p.value <= p.high, key
        linear = unit_for(p.unit, "linear")
        assert "N m" not in linear and linear != "rad", key
    made.check(made.defaults())


@every_block
def test_zero_in_gives_finite_out(made):
    system = made.system()
    x, u = np.zeros(system.nstates or 0), np.zeros(system.ninputs)
    assert np.isfinite(system.output(0.0, x, u)).all()
    if system.nstates:
        assert np.isfinite(system.dynamics(0.0, x, u)).all()


@every_block
def test_number_of_results(made):
    fresh = [o for o in made.outputs if o not in made.states]
    result = made(*arguments(made, ()), **made.defaults())
    assert len(result) == len(fresh) + len(made.states)


@every_block
def test_one_text_for_numbers_arrays_batches_and_logs(made):
    values = strong(made)
    batch = arguments(made, (7, 3))
    whole = made(*batch, **values)
    for result in whole:
        assert np.shape(result) == (7, 3)
    for i, j in ((0, 0), (3, 1), (6, 2)):
        column = made(*[a[:, j] for a in batch], **values)
        single = made(*[float(a[i, j]) for a in batch], **values)
        for of_batch, of_log, number in zip(whole, column, single, strict=True):
            assert np.shape(of_log) == (7,) and np.shape(number) == ()
            np.testing.assert_allclose(of_log, of_batch[:, j], rtol=1e-12, atol=1e-14)
            np.testing.assert_allclose(number, of_batch[i, j], rtol=1e-12, atol=1e-14)


@every_block
def test_arguments_are_not_changed(made):
    args = arguments(made, (5,))
    copies = [a.copy() for a in args]
    made(*args, **strong(made))
    for before, after in zip(copies, args, strict=True):
        assert np.array_equal(before, after)


@every_block
def test_parameters_may_differ_from_member_to_member_of_a_batch(made):
    """A sweep hands parameters over as arrays."""
    sets = [strong(made, seed) for seed in range(3)]
    sweep = {k: np.array([values[k] for values in sets]) for k in made.parameters}
    args = arguments(made, (5, 3))
    together = made(*args, **sweep)
    for j, values in enumerate(sets):
        alone = made(*[a[:, j] for a in args], **values)
        for one, every in zip(alone, together, strict=True):
            np.testing.assert_allclose(one, every[:, j], rtol=1e-12, atol=1e-14)


@every_block
def test_system_says_what_the_function_says(made):
    values = strong(made)
    system = made.system(name="some", **values)
    assert isinstance(system, ct.NonlinearIOSystem)
    assert set(system.params) == {f"some.{key}" for key in made.parameters}
    assert system.input_labels == list(made.inputs)
    assert system.output_labels == list(made.outputs)
    assert (system.state_labels or []) == list(made.states)
    args = [float(a) for a in arguments(made, ())]
    t, rest = (args[0], args[1:]) if made.timed else (0.0, args)
    u, x = rest[: len(made.inputs)], rest[len(made.inputs) :]
    fresh = [o for o in made.outputs if o not in made.states]
    expected = made(*args, **values)
    known = dict(zip(made.states, x, strict=True)) | dict(zip(fresh, expected, strict=False))
    assert np.array_equal(system.output(t, x, u), [known[o] for o in made.outputs])
    if made.states:
        assert np.array_equal(system.dynamics(t, x, u), expected[len(fresh) :])


@every_block
def test_signals_can_be_renamed_and_are_counted(made):
    names = [f"in{i}" for i in range(len(made.inputs))]
    outs = [f"out{i}" for i in range(len(made.outputs))]
    system = made.system(name="renamed", inputs=names, outputs=outs)
    assert system.input_labels == names and system.output_labels == outs
    with pytest.raises(InputError):
        made.system(outputs=[*outs, "one_more"])


@every_block
def test_unknown_and_impossible_values_are_refused(made):
    with pytest.raises(InputError, match="no parameter 'nonsense'"):
        made.check({"nonsense": 1.0})
    for key, p in made.parameters.items():
        with pytest.raises(InputError, match=key):
            made.check({key: float("nan")})
        if np.isfinite(p.low):
            with pytest.raises(InputError, match=key):
                made.check({key: p.low - 1.0})


def test_a_second_block_of_a_name_is_refused():
    with pytest.raises(InputError, match="'gravity' exists"):

        @block("effect", out="d", name="gravity")
        def other(theta):
            """d = theta."""
            return theta


# Effects.


@every_effect
def test_effect_declaration(made):
    assert made.acts in (("torque",), ("input",)) or all(
        any(key in law.parameters for law in members("friction").values()) for key in made.acts
    )
    assert len([o for o in made.outputs if o not in made.states]) == 1
    neutral = made.parameters[made.gain].neutral
    assert made.parameters[made.gain].low <= neutral <= made.parameters[made.gain].high
    assert made.experiment and not made.experiment.endswith(".")
    assert made.name not in made.confused


@every_law
@every_effect
def test_effect_at_its_neutral_value_changes_nothing(made, law):
    """Same rates at random points, and its own states stay at rest or do not matter."""
    model = model_of(law)
    neutral = strong(made) | {made.gain: made.parameters[made.gain].neutral}
    _, bare = plant_of(model)
    whole, rates = plant_of(model.with_effect(made.name, neutral))
    n = 3 + len(model.friction.block.states)  # F and the rates of theta, w, friction
    for seed in range(5):
        args = arguments(assemble(model), (20,), seed)
        own = [np.zeros(20)] * (len(whole.states) - (n - 1))
        for _ in range(10):
            step = rates(*args, *own)
            for with_effect, without in zip(step[:n], bare(*args), strict=True):
                np.testing.assert_array_equal(with_effect, without)
            own = [x + 1e-3 * rate for x, rate in zip(own, step[n:], strict=True)]


@every_effect
def test_effect_with_strength_changes_the_plant(made):
    model = model_of("lugre")
    values = {made.gain: 0.5 * min(made.parameters[made.gain].high, 0.4)}
    defaults = made.defaults() | values
    _, bare = plant_of(model)
    whole, rates = plant_of(model.with_effect(made.name, defaults))
    args = arguments(assemble(model), (20,))
    own = [np.full(20, 0.1)] * (len(whole.states) - 3)
    assert not np.array_equal(rates(*args, *own)[2], bare(*args)[2])


@pytest.mark.parametrize("made", [m for m in members("effect").values() if m.exact])
def test_exact_form_of_an_effect_at_its_neutral_value_changes_nothing(made):
    u = np.random.default_rng(0).normal(size=50)
    neutral = made.defaults() | {made.gain: made.parameters[made.gain].neutral}
    np.testing.assert_array_equal(made.exact(u, 1e-3, **neutral), u)


@every_law
def test_plant_blocks_keep_the_contract(law):
    """The plant is assembled, not registered; with every effect in it at once."""
    model = model_of(law)
    for made in members("effect").values():
        model = model.with_effect(made.name, strong(made))
    whole, rates = plant_of(model)
    assert whole.inputs == ("u", "d") and whole.outputs == ("theta", "w", "F")
    args = arguments(whole, (6, 2))
    batch = rates(*args)
    single = rates(*[float(a[4, 1]) for a in args])
    for of_batch, number in zip(batch, single, strict=True):
        assert np.shape(of_batch) == (6, 2)
        np.testing.assert_allclose(number, of_batch[4, 1], rtol=1e-12, atol=1e-14)


# Friction laws.

speeds = st.floats(-50.0, 50.0)
levels = st.floats(0.01, 5.0)


def value(made, w, z, values):
    """Torque and rates of a friction law at one point."""
    return made(w, *([z] * len(made.states)), **values)


@st.composite
def law_and_values(draw, static=False):
    """A law with random positive parameters, Fs >= Fc."""
    laws = [m for m in members("friction").values() if not (static and m.states)]
    made = draw(st.sampled_from(laws))
    values = {k: p.value * draw(st.floats(0.1, 10.0)) for k, p in made.parameters.items()}
    if "Fs" in values:
        values["Fs"] = values["Fc"] * draw(st.floats(1.0, 3.0))
    return made, values


@given(law_and_values(), speeds, st.floats(-1e-2, 1e-2))
def test_friction_is_odd(law, w, z):
    made, values = law
    forward, backward = value(made, w, z, values), value(made, -w, -z, values)
    for one, other in zip(forward, backward, strict=True):
        assert one == -other


@given(law_and_values(static=True), speeds)
def test_static_friction_dissipates(law, w):
    made, values = law
    (F,) = value(made, w, 0.0, values)
    assert F * w >= 0.0


@given(law_and_values(), speeds)
def test_friction_is_zero_at_rest_and_unbent(law, w):
    made, values = law
    assert not any(value(made, 0.0, 0.0, values))


@given(st.floats(0.05, 50.0), st.booleans(), levels, st.floats(1.0, 3.0))
def test_steady_sliding_of_lugre_is_the_static_map(speed, backwards, Fc, ratio):
    lugre, stribeck = REGISTRY["lugre"], REGISTRY["stribeck"]
    w = -speed if backwards else speed
    values = lugre.defaults() | {"Fc": Fc, "Fs": ratio * Fc, "vs": 0.03}
    h = Fc * (1.0 + (ratio - 1.0) * np.exp(-((w / 0.03) ** 2)))
    F, dz = lugre(w, np.sign(w) * h / values["sigma0"], **values)
    shared = {k: values[k] for k in ("Fc", "Fs", "Fv", "vs")}
    assert dz == pytest.approx(0.0, abs=1e-10)
    assert stribeck(w, **shared, eps=1e-4)[0] == pytest.approx(F, rel=1e-10)


@given(speeds, levels, st.floats(1.0, 3.0))
def test_bristles_never_bend_beyond_stiction(w, Fc, ratio):
    """|z| <= Fs/sigma0 is invariant: on its edge dz/dt points inwards."""
    lugre = REGISTRY["lugre"]
    values = lugre.defaults() | {"Fc": Fc, "Fs": ratio * Fc}
    edge = values["Fs"] / values["sigma0"]
    assert lugre(w, edge, **values)[1] <= 1e-12 * abs(w)
    assert lugre(w, -edge, **values)[1] >= -1e-12 * abs(w)


# Controllers and observers.


@pytest.mark.parametrize(
    "made", [pytest.param(m, id=m.name) for m in members("controller").values()]
)
def test_controllers_are_linear(made):
    values = strong(made)
    one, other = arguments(made, (9,), 1), arguments(made, (9,), 2)
    both = made(*[2.0 * a - 3.0 * b for a, b in zip(one, other, strict=True)], **values)
    for c, a, b in zip(both, made(*one, **values), made(*other, **values), strict=True):
        np.testing.assert_allclose(c, 2.0 * a - 3.0 * b, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("made", [pytest.param(m, id=m.name) for m in members("observer").values()])
def test_observers_put_out_an_odd_estimate(made):
    """Signals change sign with the drive's direction; levels and scales do not."""
    assert made.outputs[0] == "Fhat" and "w" in made.inputs
    levels = ("zeta", "excess", "ahat", "scale")
    args, values = arguments(made, (50,)), strong(made)
    signals = [*made.inputs, *made.states]
    mirrored = [a if k in levels else -a for k, a in zip(signals, args, strict=True)]
    one, other = made(*args, **values), made(*mirrored, **values)
    fresh = [k for k in made.outputs if k not in made.states]
    for k, a, b in zip([*fresh, *made.states], one, other, strict=True):
        np.testing.assert_array_equal(a, b if k in levels else -np.asarray(b))


def test_the_delay_block_keeps_its_phase():
    """Within 1 degree of exp(-s T) up to w T = 1.7, as its docstring says, and of gain 1."""
    T = 0.01
    block = REGISTRY["input_delay"].system(delay=T)
    linear = block.linearize([0.0, 0.0], [0.0])
    for x in (0.1, 0.5, 1.0, 1.7):
        response = complex(linear(1j * x / T))
        assert abs(np.angle(response * np.exp(1j * x), deg=True)) < 1.0
        assert abs(response) == pytest.approx(1.0, abs=1e-4)
