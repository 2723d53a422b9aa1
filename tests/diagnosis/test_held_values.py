"""Values that are held, bounded or known with an uncertainty, and values that cannot be."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import Stated
from lugrectl.cli import main
from lugrectl.core.errors import InputError

from ..cases import oil

TRUE = {"J": oil.J, "Fv": oil.FV}


@pytest.fixture(scope="module")
def log():
    return lg.read_record(oil.log())


def fitted(log, **values):
    return lg.identify(log, lg.Model.of(friction="viscous", **values))


def held(value):
    return {"value": value, "fixed": True}


EVERY = {
    "J": {"value": 0.0022, "fixed": True},
    "Fc": {"min": 0.1, "max": 0.5},
    "Fs": {"value": 0.3, "std": 0.02},
    "vs": {"value": 0.01, "min": 0.001},
}


def test_what_is_stated_of_a_value_is_written_and_read_again(tmp_path):
    gravity = {"name": "gravity", "amplitude": {"value": 0.2, "fixed": True}}
    model = lg.Model.of(**EVERY, effects=gravity)
    lg.write_model(model, tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text()
    assert "J = {value = 0.0022, fixed = true}" in text and "Fc = {min = 0.1, max = 0.5}" in text
    again = lg.read_model(tmp_path / "m.toml")
    assert again == model and again.held() == {"J", "gravity.amplitude"}
    assert again.stated["Fs"] == Stated(std=0.02) and again.values()["Fc"] is None


def test_a_model_says_what_is_stated_and_keeps_plain_numbers():
    model = lg.Model.of(**EVERY)
    assert "0.0022 kg m2 (held)" in repr(model) and "(0.1 to 0.5)" in repr(model)
    assert "prior +-0.02" in repr(model) and "at least 0.001" in repr(model)
    assert model.to_dict()["plant"] == {"J": 0.0022}
    assert lg.Model.of({**model.to_dict(), "stated": model.statements()}) == model
    assert json.loads(json.dumps(model.statements()))["J"] == {"fixed": True}


def test_a_plain_number_takes_the_place_of_what_was_stated():
    model = lg.Model.of(lg.Model.of(**EVERY), J=0.003)
    assert model.held() == set() and model.stated["Fc"] == Stated(low=0.1, high=0.5)


def test_fix_holds_values_of_the_plant_the_friction_and_effects():
    model = lg.Model.of(lg.table1(), effects={"name": "gravity", "amplitude": 0.2, "phase": 0.0})
    assert model.fix("J", "Fc", "gravity.phase").held() == {"J", "Fc", "gravity.phase"}
    assert model.fix("gravity").held() == {"gravity.amplitude", "gravity.phase"}
    assert model.held() == set()


WRONG = [
    ({"J": {"value": 1.0, "fixed": 1}}, "J: fixed must be True or False"),
    ({"J": {"fixed": True}}, "J: fixed needs a value"),
    ({"J": {"std": 0.1}}, "J: std needs a value"),
    ({"J": {"value": 1.0, "std": 0.0}}, "std must be a positive number"),
    ({"J": {"value": 1.0, "min": 2.0}}, "lies outside its own bounds, at least 2"),
    ({"J": {"min": 2.0, "max": 1.0}}, "min = 2 must be below max = 1"),
    ({"J": {"min": -2.0}}, "min = -2 must be above 0"),
    ({"J": {"max": "a"}}, "max must be a number"),
    ({"J": {"valu": 2.0}}, "did you mean 'value'?"),
    ({"J": {"value": True}}, "J must be a number"),
    ({"J": {"value": -1.0, "fixed": True}}, "J = -1 must be above 0"),
    ({"Fc": held(0.3), "Fs": held(0.2)}, "Fs is at most 0.2 and Fc at least 0.3"),
    ({"Fc": {"min": 0.3}, "Fs": {"max": 0.2}}, "Fs is at most 0.2 and Fc at least 0.3"),
]


@pytest.mark.parametrize(("values", "words"), WRONG, ids=range(len(WRONG)))
def test_what_cannot_be_stated_of_a_value_is_one_sentence(values, words):
    with pytest.raises(InputError) as said:
        lg.Model.of(**values)
    assert words in str(said.value) and "\n" not in str(said.value)


@pytest.mark.parametrize("key", ["J", "sigma0", "vs", "Fc"])
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf"), "1", True, 1j, [1.0], 10**400])
def test_impossible_values_are_an_input_error_where_the_model_is_given(key, value):
    with pytest.raises(InputError, match=key):
        lg.Model.of(**{key: value})
    model = lg.Model.of(lg.table1()).with_values({key: value})
    with pytest.raises(InputError, match=key):
        lg.diagnose("run.csv", model)


@pytest.mark.parametrize("names", [("Fd",), ("sigma0",), ("gravity",), (3,), ("",)])
def test_fix_names_what_the_model_does_not_have(names):
    with pytest.raises(InputError, match="^fix: "):
        lg.Model.of(J=0.002).fix(*names)


@pytest.mark.parametrize("fix", ["Fd", "Fc,sigma0", "gravity.phase"])
def test_a_wrong_fix_on_the_command_line_is_one_sentence_with_exit_2(tmp_path, capsys, fix):
    (tmp_path / "m.toml").write_text("[plant]\nJ = 0.002\n[friction]\nFc = 0.2\n")
    for command in ("diagnose", "identify"):
        typed = [command, "run.csv", "--model", str(tmp_path / "m.toml"), "--fix", fix]
        assert main(typed) == 2
        said = capsys.readouterr().err
        assert "--fix: " in said and said.count("\n") == 1


def test_a_file_with_an_impossible_value_is_named_with_the_key(tmp_path, capsys):
    path = tmp_path / "m.toml"
    path.write_text("[plant]\nJ = 0.002\n[friction]\nvs = {value = 0, fixed = true}\n")
    assert main(["identify", "run.csv", "--model", str(path)]) == 2
    assert f"{path}: [friction] vs = 0 must be above 0" in capsys.readouterr().err


@pytest.mark.slow
def test_held_values_are_not_fitted_and_are_reported_without_interval(log):
    found = fitted(log, J=held(2.2e-3), Fv=0.02)
    assert found.model.values()["J"] == 2.2e-3 and found.estimates["J"].held
    assert found.estimates["J"].ci95 is None and found.estimates["Fv"].ci95 is not None
    said = found.to_dict()
    assert said["parameters"]["J"]["held"] is True and said["model"]["plant"] == {"J": 2.2e-3}
    assert said["model"]["stated"] == {"J": {"fixed": True}}
    assert "held" in str(found) and found.model.held() == {"J"}
    said = [m for m in found.messages if "contradicts held values" in m]
    assert len(said) == 1 and "J is held at 0.0022, but would be 0.00" in said[0]


@pytest.mark.slow
def test_everything_may_be_held(log):
    found = fitted(log, **{k: held(v) for k, v in TRUE.items()})
    assert {k: found.model.values()[k] for k in TRUE} == TRUE
    assert found.error["refitted"] == pytest.approx(found.error["declared"], rel=1e-6)
    assert not any("held" in m for m in found.messages)


@pytest.mark.slow
def test_bounds_bound_and_a_value_at_its_bound_is_said(log):
    found = fitted(log, J={"value": 2.3e-3, "min": 2.1e-3}, Fv={"min": 0.01, "max": 0.05})
    assert found.model.values()["J"] == pytest.approx(2.1e-3, rel=1e-6)
    assert found.estimates["J"].ci95[0] >= 2.1e-3 * (1 - 1e-9)
    assert found.estimates["Fv"].value == pytest.approx(0.02, rel=0.2)
    assert any("J lies at its declared min = 0.0021" in m for m in found.messages)


def test_a_prior_pulls_and_a_declared_value_that_the_fit_left_is_said_with_both(log):
    free, strong = fitted(log, J=2.2e-3, Fv=0.02), fitted(log, J={"value": 2.2e-3, "std": 1e-9})
    low, high = free.estimates["J"].ci95
    assert low < 2e-3 < high and high - low < 1e-4
    said = [m for m in free.messages if "beyond their 95 % intervals" in m]
    assert len(said) == 1 and "J is 0.00" in said[0] and "declared 0.0022 kg m2" in said[0]
    assert strong.estimates["J"].value == pytest.approx(2.2e-3, rel=1e-4)


def runs_at_steady_speed():
    rng = np.random.default_rng(3)
    made = []
    for w in np.r_[np.geomspace(0.5, 20.0, 8), -np.geomspace(0.5, 20.0, 8)]:
        t = np.arange(500) * 1e-2
        u = np.sign(w) * 0.2 + 0.02 * w + rng.normal(scale=0.01, size=len(t))
        speed = w + rng.normal(scale=0.01, size=len(t))
        made.append(lg.Record(t=t, u=u, w=speed, source=f"run {w:.2g}", motion="rotary"))
    return made


@pytest.mark.slow
def test_a_map_of_runs_at_steady_speed_honours_them_too():
    model = lg.Model.of(friction="coulomb", Fc=held(0.21), Fv={"value": 0.03, "min": 0.022})
    found = lg.identify(runs_at_steady_speed(), model)
    values = found.model.values()
    assert values["Fc"] == 0.21 and values["Fv"] == pytest.approx(0.022, rel=1e-4)
    assert found.estimates["Fc"].held and found.estimates["Fc"].ci95 is None
    prior = lg.Model.of(friction="coulomb", Fc={"value": 0.21, "std": 1e-6}, Fv=0.03)
    pulled = lg.identify(runs_at_steady_speed(), prior).model.values()
    assert pulled["Fc"] == pytest.approx(0.21, rel=1e-3)
    free = lg.Model.of(friction="coulomb", Fc=0.21, Fv=0.02)
    said = " ".join(lg.identify(runs_at_steady_speed(), free).messages)
    assert "Fc is 0.2" in said and "declared 0.21 N m" in said


def test_a_map_with_stiction_declared_below_friction_is_answered():
    model = lg.Model.of(friction="stribeck", Fc=0.2, Fs=0.15, Fv=0.02, vs=0.5)
    found = lg.identify(runs_at_steady_speed(), model)
    values = found.model.values()
    assert values["Fs"] >= values["Fc"] and values["Fc"] == pytest.approx(0.2, rel=0.1)
    assert any("Fs = 0.15 is below Fc" in m for m in found.messages)


def test_a_declared_inertia_stands_where_the_log_does_not_tell_it():
    """Slow motion behind a coarse encoder, of which rows are lost: J = 0.002 is hardly seen."""
    rng = np.random.default_rng(1)
    t, count = 4e-3 * np.arange(4000), 2 * np.pi / 4096
    theta = np.sin(np.pi * t)
    w = np.gradient(theta, t)
    u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-2) + 0.02 * w
    u += 0.02 * rng.standard_normal(len(t))
    kept, late = rng.random(len(t)) > 0.3, rng.uniform(-1.5e-3, 1.5e-3, len(t))
    log = {"t": np.sort((t + late)[kept]), "u": u[kept]}
    log["theta"] = (np.round(theta / count) * count)[kept]
    fit = lg.identify(log, lg.Model.of(J=0.002, friction="coulomb"))
    assert "J" in fit.plain.uncertain
    assert fit.model.J == 0.002
    assert any("J is taken as declared" in note for note in fit.messages)


@pytest.mark.slow
def test_a_diagnosis_says_in_its_headline_that_a_held_value_is_contradicted(log):
    found = lg.diagnose(log, lg.Model.of(J=held(2.2e-3)))
    assert "But: The record contradicts held values: J is held at 0.0022" in str(found).replace(
        "\n  ", " "
    )
