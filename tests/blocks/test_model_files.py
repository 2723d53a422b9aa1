"""Model files: what is written can be read, and what cannot be meant is one sentence."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.block import P, members
from lugrectl.core.errors import InputError

HEAD = '[plant]\n[friction]\nmodel = "lugre"\n'


def write(folder, text):
    path = folder / "m.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


WRONG = [
    (HEAD + '[[effects]]\nname = ["gravity"]\n', "no effect named ['gravity']"),
    (HEAD + "[[effects]]\namplitude = 1.0\n", "[[effects]] needs a name"),
    (HEAD + '[[effects]]\nname = "gravity"\n' * 2, "gravity is declared twice"),
    ('effects = ["gravity"]\n' + HEAD, "[[effects]] must be a table"),
    ("effects = 3\n" + HEAD, "write [[effects]] above each effect"),
    ("plant = 3\n", "plant must be a table"),
    ('name = ["a"]\n' + HEAD, "name must be a text"),
    ("motion = []\n" + HEAD, "motion must be"),
    ("[plant]\n[friction]\nmodel = {a = 1}\n", "no friction model named {'a': 1}"),
    (f"[plant]\nJ = 1{'0' * 5000}\n", "not a TOML file"),
    ("[plant]\nJ = true\n", "J must be a number"),
    ("[plant]\nJ = 0\n", "J = 0 must be above 0"),
    (HEAD + "Fc = -1\n", "Fc = -1 lies outside"),
    (HEAD + "Fd = 1\n", "unknown key 'Fd'"),
    ("a = " + "[" * 9000, "not a TOML file"),
    ('name = "Prüfstand"\n'.encode("latin-1"), "UTF-8"),
]


@pytest.mark.parametrize(("text", "words"), WRONG, ids=range(len(WRONG)))
def test_what_cannot_be_meant_is_one_sentence_with_the_file(tmp_path, text, words):
    path = write(tmp_path, text)
    with pytest.raises(InputError) as said:
        lg.read_model(path)
    assert str(said.value).startswith(str(path)) and words in str(said.value)
    assert "\n" not in str(said.value)


@pytest.mark.parametrize("path", [3, None, ["m.toml"], "no.toml", ".", "a\0b"])
def test_what_is_no_model_file_is_one_sentence(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        lg.read_model(path)


@pytest.mark.parametrize(
    "entry",
    [
        'name = "torque_ripple"\nharmonic = {}\n',
        'name = "hard_stop"\nside = {}\n',
        'name = "actuator_lag"\ntime_constant = {}\n',
    ],
)
def test_two_effects_of_a_kind_that_differ_are_physics(tmp_path, entry):
    both = "".join("[[effects]]\n" + entry.format(value) for value in (-1.0, 1.0))
    both = both if "side" in entry else both.replace("-1.0", "2.0")
    model = lg.read_model(write(tmp_path, HEAD + both))
    first, second = model.effects
    assert second.key == f"{first.key}_2"


PLACES = {  # key: a file in which it has the value {}
    "name": "name = {}\n" + HEAD,
    "motion": "motion = {}\n" + HEAD,
    "blocks": "blocks = {}\n" + HEAD,
    "plant": "plant = {}\n",
    "friction": "friction = {}\n",
    "effects": "effects = {}\n" + HEAD,
    "J": "[plant]\nJ = {}\n",
    "model": "[friction]\nmodel = {}\n",
    "Fc": HEAD + "Fc = {}\n",
    "gravity amplitude": HEAD + '[[effects]]\nname = "gravity"\namplitude = {}\n',
    "[[effects]]": HEAD + "[[effects]]\nname = {}\n",
    "min": HEAD + "Fc = {{min = {}}}\n",
    "fixed": HEAD + "Fc = {{value = 0.1, fixed = {}}}\n",
    "std": HEAD + "Fc = {{value = 0.1, std = {}}}\n",
}
SHAPES = ["[1.0]", "{a = 1}", "2024-05-06", '"x"', "nan"]
MEANT = {("name", '"x"')}  # what may be written there


@pytest.mark.parametrize("key", PLACES)
@pytest.mark.parametrize("shape", SHAPES)
def test_a_wrong_shape_is_one_sentence_with_file_and_key(tmp_path, key, shape):
    path = write(tmp_path, PLACES[key].format(shape))
    if (key, shape) in MEANT:
        assert lg.read_model(path).name == "x"
        return
    with pytest.raises(InputError) as said:
        lg.read_model(path)
    text = str(said.value)
    assert text.startswith(str(path)) and "\n" not in text and len(text) < 700
    assert key in text.replace("'", "") or "[friction]" in text or "[[effects]]" in text


def values_of(p: P):
    """A value that a parameter can have, or None for one to be identified."""
    if p.choices:
        return st.sampled_from([*p.choices, None])
    low, high = max(p.low, -1e6), min(p.high, 1e6)
    found = st.floats(low, high, allow_nan=False, allow_infinity=False)
    extra = [p.neutral] if p.neutral is not None else []
    return st.one_of(found, st.sampled_from([*extra, None] if p.fitted else [p.value]))


@st.composite
def tabled(draw, p: P):
    """A value as a table: held, bounded, with an uncertainty, some of these or none."""
    value = draw(values_of(p))
    if value is None or not math.isfinite(value) or p.choices:
        return value
    made: dict = {"value": value}
    size = max(abs(value), 1e-3)
    if draw(st.booleans()):
        made["fixed"] = True
    if draw(st.booleans()):
        made["std"] = draw(st.floats(1e-9, 1e3))
    low, high = value - size * draw(st.floats(0.01, 3.0)), value + size
    if draw(st.booleans()) and low >= p.low:
        made["min"] = low
    if draw(st.booleans()) and high <= p.high:
        made["max"] = high
    return draw(st.sampled_from([made, {k: v for k, v in made.items() if k in ("min", "max")}]))


@st.composite
def models(draw):
    law = draw(st.sampled_from(sorted(members("friction"))))
    own = members("friction")[law].own
    values = {k: draw(st.one_of(values_of(p), tabled(p))) for k, p in own.items() if p.fitted}
    values = {k: v for k, v in values.items() if v not in (None, {})}
    names = draw(st.lists(st.sampled_from(sorted(members("effect"))), max_size=3, unique=True))
    effects = []
    for name in names:
        kept = members("effect")[name].own.items()
        drawn = {k: draw(st.one_of(values_of(p), tabled(p))) for k, p in kept if p.fitted}
        effects.append({"name": name, **{k: v for k, v in drawn.items() if v not in (None, {})}})
    if any(isinstance(values.get(k), dict) for k in ("Fs", "Fc")):
        values.pop("Fs", None)  # bounds that cross are refused
    return lg.Model.of(
        J=draw(st.one_of(st.none(), st.floats(1e-9, 1e6))),
        friction=law,
        effects=effects,
        name=draw(st.text(st.characters(exclude_categories=["Cs"]))),
        motion=draw(st.sampled_from(["rotary", "linear"])),
        **values,
    )


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(model=models())
def test_any_model_that_is_written_is_read_as_the_same(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "m.toml"
    lg.write_model(model, path)
    assert lg.read_model(path) == model


@pytest.mark.parametrize("name", ["bench\x00", "bench\x7f", "a\r\nb\tc", '"\\', "ÿ\u2028", ""])
def test_every_name_that_toml_can_hold_is_read_again(tmp_path, name):
    model = replace(lg.Model.of(lg.table1()), name=name)
    lg.write_model(model, tmp_path / "m.toml")
    assert lg.read_model(tmp_path / "m.toml") == model


@pytest.mark.parametrize(
    ("change", "path", "words"),
    [
        ({}, None, "path must be"),
        ({}, "no/such/folder/m.toml", "cannot be written"),
        ({"name": "bench\ud800"}, "m.toml", "surrogate"),
        ({"J": float("nan")}, "m.toml", "J must be a number"),
    ],
)
def test_what_cannot_be_written_is_one_sentence(tmp_path, monkeypatch, change, path, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=words):
        lg.write_model(replace(lg.Model.of(lg.table1()), **change), path)
    assert not list(tmp_path.iterdir())
