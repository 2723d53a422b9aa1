"""What others read of an answer: names and types, never a digit, a wording, or who wins."""

from __future__ import annotations

import json
import pickle

import matplotlib.pyplot as plt
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY
from lugrectl.cli import main

from ..cases import small_answers
from ..cases.schema import SCHEMA, jsonschema
from ..cases.small_answers import DIAGNOSES, DRIVE, FREE, IDENTIFICATIONS, answer, log, ripple

ALL = [*DIAGNOSES, *IDENTIFICATIONS]
FITTED = [name for name in ALL if name not in ("refused", "dead")]
VERDICTS = ("adequate", "found", "ambiguous", "unexplained", "refused")


@pytest.fixture(scope="module", autouse=True)
def own_effect():
    """An effect of one's own, which goes with the module."""
    small_answers.own_effect()
    yield
    REGISTRY.pop(("effect", "cubic_drag"))


def document(result):
    """The JSON of a result; NaN and infinity are none."""

    def refuse(text):
        raise AssertionError(f"{text} in the document")

    return json.loads(result.to_json(), parse_constant=refuse)


def well_formed(document, part=None):
    """As the schema of report.json says."""
    schema = SCHEMA if part is None else {"$defs": SCHEMA["$defs"], "$ref": f"#/$defs/{part}"}
    jsonschema.Draft202012Validator(schema).validate(document)


def parts(value):
    """Every mapping in a document."""
    if isinstance(value, dict):
        yield value
        value = list(value.values())
    for one in value if isinstance(value, list) else ():
        yield from parts(one)


@pytest.mark.parametrize("name", ALL)
def test_an_answer_is_a_document_that_shows_itself_and_travels(name):
    d = answer(name)
    said = document(d)
    well_formed(said)
    assert d.to_dict() == d.summary()
    assert isinstance(d.model, (lg.Model, type(None))) and isinstance(d.declared, lg.Model)
    for part in parts(said):
        for key in ("value", "torque", "share"):
            ends = part.get("share_ci95") if "share_ci95" in part else part.get("ci95")
            if ends and part.get(key) is not None and None not in ends:
                assert ends[0] <= part[key] <= ends[1], part
    speeds = [point["w"] for point in said["plain"]["curve"]]
    assert speeds == sorted(speeds) and (said["plain"]["left"] or 0.0) >= 0.0
    assert d.plain.values().keys() >= d.plain.parameters.keys()
    assert d.verdict in str(d) or name in IDENTIFICATIONS
    assert len(repr(d).splitlines()) > 1
    assert pickle.loads(pickle.dumps(d)).to_json() == d.to_json()


@pytest.mark.parametrize("name", VERDICTS)
def test_a_verdict_comes_with_what_it_needs(name):
    d = answer(name)
    assert d.verdict == name
    assert (d.reason is not None) == (name == "refused") == (d.model is None)
    assert bool(d.effects) or name not in ("found", "ambiguous")
    assert not d.effects or name not in ("adequate", "refused")
    assert any(e.alternatives for e in d.effects) == (name == "ambiguous")
    assert name not in ("ambiguous", "unexplained", "refused") or d.experiment or d.reason
    assert (d.table is not None) == (name == "unexplained")
    assert (document(d)["detectable"] is not None) == (name == "adequate")


@pytest.mark.parametrize("name", ["refused", "dead"])
def test_a_refusal_keeps_the_plain_answer(name):
    d = answer(name)
    assert d.verdict == "refused" and bool(d.plain.parameters) == (name == "refused")
    assert [r.samples for r in d.records] == [1600] * len(d.records) and d.plain.said
    with pytest.raises(lg.InputError):
        d.plot()
    for ask in (lambda: d.covariance, d.sample):
        with pytest.raises(lg.InputError):
            ask()


def test_nothing_certain_is_an_error_with_the_plain_answer():
    with pytest.raises(lg.Refused) as no:
        lg.identify(log() | {"u": np.zeros(1600)}, FREE)
    assert no.value.exit_code == 3 and isinstance(no.value.plain, lg.results.Balance)


@pytest.mark.parametrize("name", FITTED)
def test_parameters_are_those_of_the_model(name):
    d = answer(name)
    known, table = d.model.known(), d.parameters
    for row in table:
        assert row.value == pytest.approx(known[row.name]) and isinstance(row.unit, str)
        assert (row.low is None) == (row.high is None)
        assert row.declared is None or row.declared == d.declared.known()[row.name]
    assert table.names == tuple(d.estimates) and "J" not in table or table["J"].value > 0.0
    for effect in d.effects:
        assert {f"{effect.name}.{k}" for k in effect.parameters} <= set(d.estimates)


@pytest.mark.parametrize("name", ["adequate", "found", "unexplained"])
def test_the_table_of_models_and_the_budget(name):
    d = answer(name)
    rows, budget = d.comparison.rows, d.comparison.budget
    first = rows[0]
    assert (first.model, first.elpd, first.se) == ("declared", 0.0, 0.0)
    assert all(row.se >= 0.0 and row.parameters > 0 for row in rows)
    assert {c.name for c in d.ranking} <= {row.model for row in rows}
    friction = [s.rms / s.share for s in budget if s.share]
    assert friction == pytest.approx([friction[0]] * len(friction))
    terms = [s.term for s in budget]
    assert {"coulomb", "viscous", "left", "noise"} <= {*terms} and len({*terms}) == len(terms)
    assert {e.name for e in d.effects} <= {*terms} and all(s.rms >= 0.0 for s in budget)
    assert ("unknown torque" in terms) == (d.verdict == "unexplained")


def test_an_own_effect_is_found_like_the_others():
    d = answer("found")
    assert [e.name for e in d.effects] == ["gravity", "cubic_drag"]
    assert "cubic_drag.c" in d.estimates
    assert "cubic_drag" in lg.effects().names and "cubic_drag" in str(d)


@pytest.mark.parametrize("name", ["adequate", "found", "unexplained", "identified"])
def test_errors_are_of_held_out_samples(name):
    d = answer(name)
    keys = ("declared", "refitted", "augmented", "noise_floor")
    assert all(d.error[k] > 0.0 for k in keys if d.error.get(k) is not None)
    assert 0 < d.error["samples"] < sum(r.samples for r in d.records)
    assert (d.error["horizon"], d.error["signal"]) == (1.0, "theta") or name == "adequate"
    assert (d.error["declared"] is None) == (d.declared.known().get("J") is None)
    tr = d.traces
    assert tr.held_out.dtype == bool and 0 < tr.held_out.sum() < len(tr.t)
    for curve in (tr.measured, *tr.simulated.values(), *tr.residual.values()):
        assert curve.shape == tr.t.shape
    assert {"w", "u"} <= tr.signals.keys() and "refitted" in tr.simulated


@pytest.mark.parametrize("name", FITTED)
def test_members_are_drawn_from_one_distribution(name):
    members = document(answer(name))["members"]
    assert sum(m["weight"] for m in members) == pytest.approx(1.0)
    assert len(members) == 1 + len(answer(name).rivals)
    for m in members:
        n, C = len(m["names"]), np.array(m["matrix"])
        assert C.shape == (n, n) and len(m["values"]) == len(m["positive"]) == n
        assert np.allclose(C, C.T) and (n == 0 or np.linalg.eigvalsh(C)[0] > -1e-9 * np.trace(C))
        assert not {*m["names"]} & {*m["unknown"]}
        lg.Model.of(m["model"])  # reads back


def in_vain():
    """A log that is refused at once."""
    return {"t": 1e-2 * np.arange(400), "u": np.zeros(400), "w": np.sin(np.arange(400.0))}


@pytest.mark.parametrize("name", ["adequate", "found", "ambiguous", "identified"])
def test_samples_of_the_covariance(name):
    d = answer(name)
    covered, drawn = d.covariance, d.sample(50, seed=3)
    assert np.asarray(covered).shape == (len(covered.names),) * 2
    assert document(d)["covariance"]["names"] == list(covered.names)
    assert {*covered.names} <= {*drawn.names} and len(drawn) == 50
    assert drawn["J"].shape == (50,) and (d.rivals or isinstance(drawn[0], lg.Model))
    np.testing.assert_array_equal(drawn["J"], d.sample(50, seed=3)["J"])
    values = np.array([d.parameters[k].value for k in covered.names])
    np.testing.assert_allclose(covered.values, values)
    assert d.rivals or drawn.columns_of().keys() == {f"plant.{k}" for k in drawn.names}


def test_samples_have_the_covariance_of_the_fit():
    d = answer("identified")
    drawn, names = d.sample(16_000, seed=0), list(d.covariance.names)
    x, C = d.covariance.values, np.asarray(d.covariance)
    size = np.sqrt(np.diag(C)) / x
    logs = np.log([drawn[k] for k in names])
    np.testing.assert_allclose(logs.std(axis=1), size, rtol=0.05)
    np.testing.assert_allclose(np.corrcoef(logs), C / np.outer(size * x, size * x), atol=0.05)
    own = drawn[7].known()
    assert {k: own[k] for k in names} == {k: drawn[k][7] for k in names}


def test_samples_go_into_a_simulation_a_sweep_and_a_search_for_cycles():
    drawn, t = answer("identified").sample(4), np.linspace(0.0, 0.1, 11)
    one = lg.simulate(drawn[0], t, {"u": 1.0}).outputs[1]
    many = lg.sweep(lg.plant(DRIVE), t, [1.0, 0.0], drawn, outputs=["w"])
    assert np.allclose(many["w"][0], one, rtol=1e-4)
    assert lg.limit_cycles(drawn[0], kp=2.0, ki=1.0, kd=0.1)


def test_models_are_drawn_by_their_weights():
    d = answer("ambiguous")
    drawn, others = d.sample(1000, seed=3), sum(rival.weight for rival in d.rivals)
    with_it = np.isfinite(drawn[f"{d.effects[0].name}.phase"])
    assert 0.1 < np.mean(with_it) == pytest.approx(1.0 - others, abs=0.05)
    with pytest.raises(lg.InputError, match="different models"):
        drawn.columns_of("plant")


@pytest.mark.parametrize("name", ["adequate", "found", "identified"])
def test_residuals_are_tested(name):
    found = answer(name).residuals
    assert found.autocorrelation[0] == pytest.approx(1.0) and found.bound > 0.0
    assert isinstance(found.white, bool) and isinstance(found.independent, bool)
    assert name != "adequate" or found.plot() is not None


def test_the_table_of_an_unknown_torque_is_a_block():
    d = answer("unexplained")
    block = d.table.block(name="left", outputs=["d_left"])
    assert block.input_labels == list(d.table.signals) and block.output_labels == ["d_left"]
    assert d.table.signals[0] in d.depends_on and d.table.values.shape[-1] == len(d.table.points)
    assert np.all(np.diff(d.table.points) > 0.0) and np.all(d.table.error >= 0.0)


def test_a_map_has_a_point_for_each_run():
    for name in ("map", "identified map"):
        d = answer(name)
        assert len(d.map.w) == len(d.map.u) == len(d.records) == 10
        assert d.map.held_out.dtype == bool and "refitted" in d.map.curves
        assert all(curve.shape == d.map.at.shape for curve in d.map.curves.values())
        assert d.error["signal"] == "u" and d.error["unit"] == "N m"
        assert d.map.plot() is not None


def test_sums_say_how_to_separate_them():
    d = answer("one way")
    (both,) = [c for c in d.plain.combinations if "constant_torque" in c.text]
    assert "Fc" in both.text and both.to_separate and both.ci95[0] <= both.value <= both.ci95[1]
    assert {"Fc", "constant_torque"} & d.plain.parameters.keys() == set()
    assert any(e.together for e in d.estimates.values()) and d.experiment


def test_the_balance_alone_and_the_bench_tests():
    found = lg.balance(log())
    well_formed(document(found), "plain")
    assert {"J", "Fc", "Fv"} <= found.parameters.keys() and found.curve
    assert found.residual.value.shape == found.residual.t.shape
    assert len(found.plot()) > 3 and "Fc" in repr(found) and found._repr_html_()
    (test,) = document(lg.balance(small_answers.steady()))["bench_tests"]
    assert test["kind"] == "staircase" and {"Fc", "Fv"} <= test["values"].keys()
    assert len(test["table"]["columns"]) == len(test["table"]["rows"][0])


@pytest.mark.slow
def test_an_answer_shows_itself_in_a_notebook():
    page = answer("refused")._repr_html_()
    assert "<h1>" in page and "<svg" in page


@pytest.mark.parametrize("name", ["unexplained", "found", "map"])
def test_an_answer_is_drawn(name):
    d = answer(name)
    assert np.size(d.plot()) >= (2 if d.error else 1)
    _, ax = plt.subplots()
    assert d.plot(ax) is ax


def test_results_are_tables():
    pandas = pytest.importorskip("pandas")
    d = answer("unexplained")
    made = (d, d.parameters, d.covariance, d.plain, d.table, d.residuals, d.sample(5))
    for one in (*made, answer("map").map):
        assert isinstance(one.to_frame(), pandas.DataFrame) and len(one.to_frame())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["refused", "identified map"])
def test_three_files_are_written(name, tmp_path):
    d = answer(name)
    names = {path.name for path in d.save(tmp_path)}
    assert {"report.html", "report.json"} <= names
    assert json.loads((tmp_path / "report.json").read_text()) == document(d)
    assert "model.toml" in names or name == "refused"
    if name != "refused":
        again = lg.read_model(tmp_path / "model.toml")
        assert again.known() == pytest.approx(d.model.known())


@pytest.mark.slow
def test_the_model_that_is_found_is_adequate():
    made = log(load=small_answers.weight_and_drag)
    assert lg.diagnose(made, answer("found").model).verdict == "adequate"


@pytest.mark.slow
def test_options():
    """Half held out, a horizon, what matters at least, and progress."""
    seen = []
    d = lg.diagnose(
        log(load=ripple), DRIVE, holdout="last", horizon=0.5, least=0.9, seed=4, alpha=0.02,
        time_limit=60.0, progress=lambda share, what: seen.append((share, what)),
    )  # fmt: skip
    assert d.verdict == "adequate" and d.comparison.least == 0.9
    assert d.error["horizon"] == 0.5 and d.free_error["in_sample"] is False
    assert answer("found").free_error["in_sample"] is True
    shares = [share for share, _ in seen]
    assert len(seen) > 2 and shares == sorted(shares) and 0.0 <= shares[0] and shares[-1] <= 1.0
    assert all(isinstance(what, str) for _, what in seen)


def test_another_run_is_held_out():
    d = lg.identify(log(6.0), FREE, holdout=log(4.0, seed=3))
    assert d.error["samples"] <= 800 and d.error["declared"] is None
    well_formed(document(d))


@pytest.mark.parametrize(
    "wrong",
    [
        {"horizon": -1.0}, {"seed": -1}, {"least": 2.0}, {"alpha": 0.0},
        {"time_limit": -1.0}, {"law": "none of them"}, {"rate": -1.0},
    ],
    ids=lambda wrong: next(iter(wrong)),
)  # fmt: skip
def test_a_wrong_argument_is_one_sentence(wrong):
    with pytest.raises(lg.InputError) as no:
        lg.diagnose(log(1.0), DRIVE, **wrong)
    said = str(no.value)
    assert "\n" not in said and next(iter(wrong)).replace("_", " ") in said.replace("_", " ")


def test_a_value_that_is_held_stays():
    model = lg.Model.of(J={"value": 0.002, "fixed": True}, friction="coulomb")
    d = lg.identify(log(4.0), model)
    assert d.estimates["J"].held and d.parameters["J"].value == 0.002
    assert document(d)["parameters"]["J"]["held"] is True
    assert "J" not in d.covariance.names and document(d)["model"]["stated"]["J"] == {"fixed": True}


def test_logs_are_diagnosed_each():
    fleet = lg.diagnose_each([in_vain(), in_vain()], DRIVE)
    for row in document(fleet)["records"]:
        well_formed(row["diagnosis"])
    errors = {"signal", "unit", "declared", "refitted", "augmented", "noise_floor"}
    assert fleet.rows[0].keys() >= {"file", "verdict", "effects", "message", *errors}
    assert fleet.counts["refused"] == 2 and {*fleet.counts} == {*VERDICTS, "failed"}
    assert fleet.exit_code == 3 and len(fleet.diagnoses) == 2 and not fleet.failed


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory: a log and a model."""
    monkeypatch.chdir(tmp_path)
    rows, head = log(5.0), "t,u,theta"
    np.savetxt("run.csv", np.c_[*rows.values()], "%.9g", ",", header=head, comments="")
    lg.write_model(lg.Model.of(J=0.002, friction="viscous"), "model.toml")
    return tmp_path


def said(capsys, line, code=0):
    """The document that a command prints."""
    assert main(line.split()) == code
    return json.loads(capsys.readouterr().out)


def test_commands_print_the_same_documents(folder, capsys):
    line = "run.csv --model model.toml --json"
    d = said(capsys, f"diagnose {line} --fix J --law coulomb")
    well_formed(d)
    assert d["parameters"]["J"]["held"] and d["model"]["friction"]["model"] == "coulomb"
    assert [f["name"] for f in d["provenance"]["files"]] == ["run.csv", "model.toml"]

    well_formed(said(capsys, "plot run.csv --json --out log.png"), "plain")


def test_a_refusal_is_printed_and_exits_3(folder, capsys):
    rows = np.c_[*in_vain().values()]
    np.savetxt("dead.csv", rows, "%.9g", ",", header="t,u,w", comments="")
    line = "diagnose dead.csv --model model.toml --json"
    well_formed(said(capsys, line, code=3))
    (one,) = said(capsys, f"{line} --each --jobs 1", code=3)["records"]
    assert one["exit_code"] == 3 and one["diagnosis"]["verdict"] == "refused"


def test_an_answer_without_a_simulation_says_why_it_has_no_error():
    found = lg.diagnose(log(4.0, mean=14.0), FREE)
    said = document(found)
    well_formed(said)
    assert said["error"] is None and any("errors of a simulation" in m for m in found.messages)
