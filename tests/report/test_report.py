"""Reports and plots of made-up diagnoses: what they say, that they are whole and safe."""

import html
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lugrectl import report
from lugrectl.blocks.model import Model, read_model, table1
from lugrectl.core import writing
from lugrectl.core.display import with_interval
from lugrectl.core.errors import InputError
from lugrectl.diagnosis.diagnose import Identification
from lugrectl.diagnosis.result import VERDICTS
from lugrectl.estimates.findings import Balance, Estimate
from lugrectl.report import diagnosis_plots, wording

from ..cases.html_page import safe
from ..cases.made_up import HOSTILE, bare, diagnosis

# --- text --------------------------------------------------------------------------------


@pytest.mark.parametrize("verdict", VERDICTS)
def test_text_starts_with_the_verdict_and_fits_80_columns(verdict):
    said = report.text(diagnosis(verdict))
    assert said.startswith(verdict)
    assert max(map(len, said.splitlines())) <= 80
    assert "nan" not in said.lower() and "None" not in said


def test_a_record_against_held_values_is_in_the_headline():
    said = "The record contradicts held values: J is held at 0.018, but would be 0.015 kg m2."
    held = replace(diagnosis("adequate"), messages=(said,))
    assert " ".join(report.text(held).split()).startswith(
        f"adequate No missing effect was detected. But: {said}"
    )


def test_why_the_plain_balance_does_not_give_a_value_is_said():
    wide = {"J": Estimate(0.002, "kg m2", (-0.01, 0.5))}
    said = report.plain_text(Balance(uncertain=wide))
    assert "J is not certain, 0.0 to 0.5 kg m2: that needs faster changes of speed." in said


def test_text_says_what_was_found_and_how_much_it_helps():
    said = report.text(diagnosis())
    assert said.startswith("found: torque_ripple\n")
    first = " ".join(said.split("\n\n")[0].split())
    assert "torque_ripple, 8 per turn, amplitude 50.1 mN m, 11 % of friction" in first
    assert "of w on held-out samples goes from 0.210 to 0.0210 rad/s." in first
    assert "r_e = A sin(N theta + phi)" in said
    assert re.search(r"amplitude +0\.0501 +0\.0489 to 0\.0513 +N m", said)
    assert re.search(r"w, restarted +rad/s +- +0\.210 +0\.0210 +0\.0101 +90 %", said)
    assert re.search(r"torque +mN m +40\.0 +36\.0 +2\.20 +- +94 %", said)
    assert re.search(r"J +0\.0024\d* +0\.0022\d* +0\.00213\d* to 0\.00227\d* +kg m2", said)
    assert "periodic_disturbance (r_e = A sin(2 pi f t + phi))" in " ".join(said.split())


def test_the_share_of_the_motion_that_is_simulated_stands_beside_its_error():
    fit = {"declared": None, "refitted": 87.25, "augmented": 99.98766}
    d = diagnosis(error=diagnosis().error | {"fit": fit})
    assert "NRMSE fit of this motion: refitted 87 %, augmented 99.988 %." in report.text(d)


def test_text_of_the_other_verdicts():
    assert "Explain it equally well: periodic_disturbance" in report.text(diagnosis("ambiguous"))
    assert "Record slow moves both ways." in report.text(diagnosis("ambiguous"))
    assert "depends on theta" in report.text(diagnosis("unexplained")).splitlines()[1]
    assert "u is constant." in report.text(diagnosis("refused"))
    adequate = report.text(diagnosis("adequate"))
    assert "  90 %" not in adequate and "Missing" not in adequate


def test_an_identification_shows_each_declared_value_beside_the_fitted_one():
    model = Model.of(table1())
    fitted = {
        "J": Estimate(0.0022, "kg m2", (0.0021, 0.0023)),
        "Fv": Estimate(0.02, "N m s/rad", None),
    }
    error = {k: v for k, v in diagnosis().error.items() if k != "augmented"}
    declared = model.with_values({"J": 0.0024, "Fv": None})
    record = diagnosis().record
    made = Identification(
        estimates=fitted, error=error, model=model, record=record, declared=declared
    )
    said = report.text(made)
    assert re.search(r"parameter +declared +fitted +95 % interval +unit", said)
    assert re.search(r"J +0\.0024\d* +0\.0022\d* +0\.0021\d* to 0\.0023\d* +kg m2", said)
    assert re.search(r"Fv +- +0\.02\d* +- +N m s/rad", said)


@given(st.floats(-1e5, 1e5), st.floats(1e-5, 1e4))
@example(2.388e-6, 1.2e-8)
def test_interval_text_keeps_the_interval(middle, width):
    """A place of the last digit is at most a fifth of it: more digits would say nothing."""
    low, high = middle - width / 2, middle + width / 2
    value, text = with_interval(Estimate(middle, "1", (low, high)))
    shown = [float(x) for x in (value, *text.split(" to "))]
    assert np.allclose(shown, [middle, low, high], rtol=0, atol=0.11 * width)


@given(st.lists(st.floats(0, 1e3), min_size=1), st.sampled_from(["m", "rad/s", "N m", "1"]))
def test_readable_units_change_no_value(values, unit):
    factor, shown = wording.readable(values, unit)
    assert {1.0: "", 1e3: "m", 1e6: "u"}[factor] + unit == shown
    assert factor == 1.0 or max(values) * factor >= 0.1 or max(values) <= 1e-7


# --- HTML --------------------------------------------------------------------------------


@pytest.mark.parametrize("verdict", ["found", "refused"])
def test_page_is_whole_self_contained_and_safe(verdict):
    d = diagnosis(verdict)
    written = report.html(d)
    page = safe(written)
    drawn = re.findall(r'\bd="([^"]*)"', written)
    assert bool(drawn) == (verdict == "found")
    assert not any("nan" in x.lower() or "inf" in x.lower() for x in drawn)
    style = "".join(page.said)
    assert "url(" not in style.replace("url(#", "") and "@import" not in style
    assert HOSTILE in style and page.tags.count("figure") == len(diagnosis_plots.figures(d))
    ids = [v for k, v in page.attributes if k == "id"]
    assert len(ids) == len(set(ids))


# --- files -------------------------------------------------------------------------------


def content(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir()}


def test_write_makes_three_files_that_agree(tmp_path):
    d, folder = bare(), tmp_path / "a" / "b"
    paths = report.write(d, folder)
    assert [p.name for p in paths] == sorted(content(folder), key=list(report.FILES).index)

    def refuse(word):
        raise AssertionError(word)

    document = json.loads((folder / "report.json").read_text(), parse_constant=refuse)
    assert document["verdict"] == "found" and document["free_error"]["declared"] is None
    said = document["headline"]
    assert said == report.headline(d)[1] and said in html.unescape(
        (folder / "report.html").read_text()
    )
    assert read_model(folder / "model.toml").values() == d.model.values()
    assert list(tmp_path.iterdir()) == [tmp_path / "a"]


def test_the_report_of_a_refusal_has_no_model_file(tmp_path):
    paths = report.write(bare("refused"), tmp_path / "out")
    assert [p.name for p in paths] == ["report.html", "report.json"]
    assert all(map(Path.exists, paths))
    assert json.loads(paths[1].read_text())["verdict"] == "refused"


def test_write_replaces_its_own_files_and_no_others(tmp_path):
    (tmp_path / "log.csv").write_text("mine")
    report.write(bare("found"), tmp_path)
    report.write(bare("adequate"), tmp_path)
    assert set(content(tmp_path)) == {"log.csv", *report.FILES}
    assert json.loads((tmp_path / "report.json").read_text())["verdict"] == "adequate"


@pytest.mark.parametrize("fails", range(6))
def test_a_failure_half_way_leaves_everything_as_it_was(tmp_path, monkeypatch, fails):
    report.write(bare("found"), tmp_path)
    before, calls, move = content(tmp_path), [], writing.os.replace

    def breaking(source, target):
        calls.append(source)
        if len(calls) == fails + 1:
            raise OSError(28, "No space left on device")
        move(source, target)

    monkeypatch.setattr(writing.os, "replace", breaking)
    with pytest.raises(InputError, match="No space left"):
        report.write(bare("adequate"), tmp_path)
    assert content(tmp_path) == before


@pytest.mark.parametrize("method", ["write_text", "mkdir"])
def test_a_failure_leaves_no_new_folder(tmp_path, monkeypatch, method):
    def broken(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(writing.Path, method, broken)
    with pytest.raises(InputError, match="Read-only"):
        report.write(bare(), tmp_path / "new" / "folder")
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_where_nothing_can_be(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="not a folder"):
            report.check_folder(folder)
        with pytest.raises(InputError, match="cannot be written"):
            report.write(bare(), folder)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_the_model_file_says_how_well_its_values_are_known():
    d = diagnosis()
    known = {
        "J": d.estimates["J"],
        "Fc": Estimate(0.285, "N m"),
        "Fv": Estimate(0.018, "", held=True),
    }
    said = wording.toml_of(replace(d, estimates=known), None)
    lines = {line.split(" = ")[0]: line for line in said.splitlines() if " = " in line}
    assert lines["Fc"].endswith("# N m, not determined")
    low, high = d.estimates["J"].ci95
    assert float(lines["J"].split("std ")[1]) == pytest.approx((high - low) / 3.92, rel=0.05)
    assert lines["Fv"].endswith("# N m s/rad") and lines["harmonic"].endswith("# 1/rev")
