"""What there is can be listed: effects, laws, observers, controllers."""

import pickle

import pytest

import lugrectl as lg
from lugrectl.blocks.block import P, members
from lugrectl.blocks.model import model_from_dict

OBSERVERS = (
    "natural existing proposed friedland_park adaptive disturbance extended_state temperature "
    "friction_state normal_force lyapunov general_coulomb position_coulomb position_lugre"
)
LISTS = {"effect": lg.effects, "friction": lg.laws}
SIZE = P(0.0, "N m", neutral=0.0)
LISTS |= {"observer": lg.observers, "controller": lg.controllers}


@pytest.fixture
def own():
    """A user's own effect."""

    def register(name, kind="effect", **options):
        def torque(t, size=SIZE):
            """r_e = s.

            In a log: not at all.

            References
            ----------
            The user, 2024.
            """
            return size + 0.0 * t

        return lg.block(kind, name=name, out="d", acts="torque", **options)(torque)

    return register


def test_the_lists_are_complete_and_have_a_factory_for_each_controller():
    assert lg.effects().names == tuple(members("effect"))
    assert lg.laws().names == tuple(members("friction"))
    assert {f"{name}_observer" for name in OBSERVERS.split()} <= set(lg.observers().names)
    assert all(callable(getattr(lg, name)) for name in lg.controllers().names)
    assert lg.controllers().names[:6] == tuple(
        "error pi pid compensation feedforward prefilter".split()
    )


@pytest.mark.parametrize("kind", LISTS)
def test_an_entry_says_equation_and_units(kind):
    for entry in LISTS[kind]():
        assert entry.equation and not entry.equation.endswith(".")
        assert all(p.unit for p in entry.parameters.values())
        assert entry.name in str(entry) and max(map(len, str(entry).splitlines())) <= 80
        assert pickle.loads(pickle.dumps(entry)) == entry


def test_a_list_is_a_sequence_that_names_index():
    listed = lg.effects()
    assert listed["torque_ripple"] is listed[2] and len(listed[1:3]) == 2
    assert listed["cogging"].name == "torque_ripple" and "gravity" in listed
    assert lg.observers()["natural"].name == "natural_observer"
    assert [entry.name for entry in listed] == list(listed.names)
    with pytest.raises(lg.InputError, match="'torque_ripel'; did you mean 'torque_ripple'"):
        listed["torque_ripel"]
    with pytest.raises(lg.InputError, match="this list has no effect named 'gravity'"):
        listed[:1]["gravity"]
    with pytest.raises(IndexError):
        listed[99]


def test_entries_are_found_by_author():
    assert lg.observers("tafazoli").names == ("position_coulomb_observer",)
    assert "adaptive_slotine_li" in lg.controllers("Slotine").names
    assert lg.observers("MORGÜL Odabaş").names == lg.observers("odabas morgul").names
    assert set(lg.observers("olsson").names) < set(lg.observers().names)
    with pytest.raises(lg.InputError, match="no observer is about 'nobody'"):
        lg.observers("nobody")
    with pytest.raises(lg.InputError, match="about = 3"):
        lg.laws(3)  # type: ignore[arg-type]


def test_a_list_prints_each_entry_in_a_few_lines():
    said = str(lg.effects()[:2])
    assert said.startswith("constant_torque\n  r_e = T0\n  parameters: torque [N m]\n")
    assert "\ngravity\n" in said and repr(lg.effects()[:2]) == said
    assert "source: Gao" in str(lg.observers())


def test_a_users_block_appears_by_itself(own):
    own("hysteresis_of_mine", source="")
    entry = lg.effects()["hysteresis_of_mine"]
    assert entry.source == "The user, 2024." and entry.about == "In a log: not at all."
    assert "hysteresis_of_mine" in str(lg.effects())


@pytest.mark.parametrize("name", ["cogging", "Detent", "torque-ripple", "Torque Ripple"])
def test_common_names_are_understood_wherever_an_effect_is_named(name):
    model = lg.Model.of(lg.table1())
    data = model.to_dict() | {"effects": [{"name": name, "amplitude": 0.1}]}
    added = model.with_effect(name, {"amplitude": 0.1})
    for made in (model_from_dict(data, "my.toml"), added):
        (part,) = made.effects
        assert part.key == part.block.name == "torque_ripple"
        assert made.to_dict()["effects"][0]["name"] == "torque_ripple"
    assert added.with_effect("torque_ripple").effects[1].key == "torque_ripple_2"
    ripple = lg.effect(name, amplitude=0.1, harmonic=6)
    assert list(ripple.params) == list(lg.effect("torque_ripple").params)


@pytest.mark.parametrize(
    "name, size", [("cogging", "amplitude"), ("torque_constant_ripple", "ratio")]
)
def test_a_periodic_effect_of_some_size_needs_its_period(name, size):
    with pytest.raises(lg.InputError, match="harmonic is missing: giv"):
        lg.effect(name, **{size: 0.1})
    assert lg.effect(name, **{size: 0.0}).params.keys() == lg.effect(name).params.keys()


def test_the_default_period_of_ones_own_is_that_of_the_drive():
    @lg.block("effect", out="d", acts="torque")
    def own_ripple(theta, a=lg.P(0.0, "N m", 0, neutral=0), harmonic=lg.P(6.0, "1/rev")):
        return a * harmonic * theta

    assert lg.effect("own_ripple", a=0.1).params["own_ripple.harmonic"] == 6.0


def test_a_users_block_goes_before_a_common_name(own):
    made = own("cogging")
    model = lg.Model.of(lg.table1()).with_effect("cogging")
    assert model.effects[0].block is made and model.to_dict()["effects"][0]["name"] == "cogging"
    assert "cogging" not in lg.effects()["torque_ripple"].also_called
    assert lg.effects()["detent"].name == "torque_ripple"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("backlsh", "did you mean 'backlash'?"),
        ("coging", "did you mean 'cogging'?"),
        ("zzz", "known: constant_torque, gravity"),
        (None, "known: constant_torque"),
    ],
)
def test_an_unknown_name_is_one_sentence_with_the_nearest(name, words):
    model = lg.Model.of(lg.table1())
    data = model.to_dict() | {"effects": [{"name": name}]}
    tries = [
        lambda: model.with_effect(name),
        lambda: lg.effect(name),
        lambda: model_from_dict(data, "my.toml"),
    ]
    for attempt in tries:
        with pytest.raises(lg.InputError) as caught:
            attempt()
        said = str(caught.value)
        assert f"there is no effect named {name!r}" in said and words in said
    assert said.startswith("my.toml: [[effects]]: ")


def test_a_friction_law_is_named_in_any_capitals():
    assert lg.friction("LuGre").nstates == 1
    with pytest.raises(lg.InputError, match="no friction law named 'lugr'; did you mean 'lugre'"):
        lg.friction("lugr")
