"""The contract that every registered block keeps, whoever wrote it."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lugrectl.blocks.block import REGISTRY, members, unit_for
from lugrectl.blocks.declaration import block
from lugrectl.core.errors import InputError
from lugrectl.loops import friction_loops as _loops  # noqa: F401  fills the registry

from ..cases.drives import arguments, strong

KINDS = {"friction", "plant", "observer", "controller", "effect"}
BLOCKS = [pytest.param(made, id=f"{kind}-{name}") for (kind, name), made in REGISTRY.items()]
every_block = pytest.mark.parametrize("made", BLOCKS)


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
    result = made(*arguments(made, ()), **made.defaults())
    assert len(result) == len(made.fresh) + len(made.states)
    assert set(made.fresh) == set(made.outputs) - set(made.states)


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


def test_kinds_have_names_of_their_own():
    """The Stribeck law and the effect that makes Coulomb friction one."""
    assert members("friction")["stribeck"] is not members("effect")["stribeck"]
    assert REGISTRY["friction", "stribeck"].outputs == ("F",)
    assert REGISTRY["effect", "stribeck"].acts == ("Fc",)
    assert REGISTRY["lugre"] is members("friction")["lugre"]
    assert REGISTRY.get("no such block") is None


def test_a_choice_is_refused_in_between():
    stop = members("effect")["hard_stop"]
    stop.check({"side": -1.0})
    with pytest.raises(InputError, match=r"hard_stop.side = 0.5 must be -1 or 1"):
        stop.check({"side": 0.5})


# Friction laws.

speeds = st.floats(-50.0, 50.0)
levels = st.floats(0.01, 5.0)


SIGNLESS = ("lost",)  # a part of a level, the same for both directions


def value(made, w, z, values):
    """Torque and rates of a friction law at one point; of an even state the rate by its sign."""
    even = [s in SIGNLESS for s in made.states]
    F, *rates = made(w, *(abs(z) if e else z for e in even), **values)
    side = np.sign(w) or np.sign(z)
    return F, *(side * r if e else r for e, r in zip(even, rates, strict=True))


@st.composite
def law_and_values(draw, static=False):
    """A law with random positive parameters, Fs >= Fc."""
    laws = [m for m in members("friction").values() if not (static and m.states)]
    made = draw(st.sampled_from(laws))
    values = {
        k: float(np.clip(p.value * draw(st.floats(0.1, 10.0)), p.low, p.high))
        for k, p in made.parameters.items()
    }
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
    lugre, stribeck = (members("friction")[law] for law in ("lugre", "stribeck"))
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
    lugre = members("friction")["lugre"]
    values = lugre.defaults() | {"Fc": Fc, "Fs": ratio * Fc}
    edge = values["Fs"] / values["sigma0"]
    assert lugre(w, edge, **values)[1] <= 1e-12 * abs(w)
    assert lugre(w, -edge, **values)[1] >= -1e-12 * abs(w)


# Controllers and observers.


EVEN = {  # nonlinear controllers, and their signals that are levels
    "adaptive_slotine_li": ("Jhat", "Fvhat", "Fchat"),
    "dual_observer_control": ("S0", "S1", "T"),
    "backstepping_smc": (),
    "coulomb_predictor": ("ahat",),
    "coulomb_compensation": ("ahat",),
}
CONTROLLERS = members("controller").values()


@pytest.mark.parametrize("made", [pytest.param(m, id=m.name) for m in CONTROLLERS])
def test_controllers_put_out_an_odd_torque(made):
    even, values, args = EVEN.get(made.name, ()), strong(made), arguments(made, (50,))
    signals = [*made.inputs, *made.states]
    mirrored = [a if k in even else -a for k, a in zip(signals, args, strict=True)]
    fresh = [k for k in made.outputs if k not in made.states]
    both = zip(made(*args, **values), made(*mirrored, **values), strict=True)
    for k, (a, b) in zip([*fresh, *made.states], both, strict=True):
        np.testing.assert_array_equal(a, b if k in even else -np.asarray(b))


@pytest.mark.parametrize(
    "made", [pytest.param(m, id=m.name) for m in CONTROLLERS if m.name not in EVEN]
)
def test_controllers_are_linear(made):
    """Away from their limits, if they have any."""
    values = strong(made) | ({"limit": np.inf} if "limit" in made.parameters else {})
    one, other = arguments(made, (9,), 1), arguments(made, (9,), 2)
    both = made(*[2.0 * a - 3.0 * b for a, b in zip(one, other, strict=True)], **values)
    for c, a, b in zip(both, made(*one, **values), made(*other, **values), strict=True):
        np.testing.assert_allclose(c, 2.0 * a - 3.0 * b, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("made", [pytest.param(m, id=m.name) for m in members("observer").values()])
def test_observers_put_out_an_odd_estimate(made):
    """Signals change sign with the drive's direction; levels and scales do not."""
    assert made.outputs[0] == "Fhat" and {"w", "theta"} & set(made.inputs)
    levels = ("zeta", "excess", "ahat", "scale", "slip")
    args, values = arguments(made, (50,)), strong(made)
    signals = [*made.inputs, *made.states]
    mirrored = [a if k in levels else -a for k, a in zip(signals, args, strict=True)]
    one, other = made(*args, **values), made(*mirrored, **values)
    fresh = [k for k in made.outputs if k not in made.states]
    for k, a, b in zip([*fresh, *made.states], one, other, strict=True):
        np.testing.assert_array_equal(a, b if k in levels else -np.asarray(b))
