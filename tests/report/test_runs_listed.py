"""Of several runs, every one is named: in the text, the page, the JSON and the short repr."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import read_record
from lugrectl.estimates.findings import FrictionMap, Share
from lugrectl.report import html, text
from lugrectl.report.diagnosis_plots import bars

from ..cases.made_up import bare, diagnosis


def run(name, samples):
    t = 2e-3 * np.arange(samples)
    log = {"t": t, "u": np.sin(9.0 * t), "w": np.sin(7.0 * t)}
    return replace(read_record(log), source=name)


@pytest.fixture(scope="module")
def found():
    runs = run("morning.csv", 600), run("evening.csv", 800)
    return replace(bare(), record=runs[0], records=runs)


def test_every_run_is_named_in_the_text_the_page_and_the_repr(found):
    for said in (text(found), html(found)):
        assert "morning.csv: 600 samples" in said and "evening.csv: 800 samples" in said
    assert "morning.csv, evening.csv: 1400 samples" in repr(found)


def test_json_lists_all_records(found):
    d = found.to_dict()
    assert [r["name"] for r in d["records"]] == ["morning.csv", "evening.csv"]
    assert d["records"][0] == {"name": "morning.csv", **d["record"]}


def test_a_single_record_is_listed_as_before():
    d = bare()
    assert d.to_dict()["records"] == [{"name": d.record.source, **d.to_dict()["record"]}]
    assert replace(d, record=None).to_dict()["records"] == []


def test_the_runs_of_a_map_are_named_and_many_runs_end_in_names():
    runs = tuple(run(f"run{i}.csv", 200) for i in range(10))
    said = text(replace(bare(), records=runs))
    assert said.count("samples at") == 8 and "2 more: run8.csv and run9.csv." in said
    w, held = np.arange(10.0), np.zeros(10, bool)
    map = FrictionMap(w, w, w, held, w, {"refitted": w}, "rotary")
    said = " ".join(text(replace(bare(), records=runs, map=map)).split())
    assert "10 runs at steady speed: run0.csv, run1.csv," in said


def test_gravity_has_the_colour_of_an_effect_in_the_budget():
    d = diagnosis()
    heavy = Share("gravity", 0.1, 0.3, None, ("theta",))
    ax = bars(replace(d, comparison=replace(d.comparison, budget=(heavy, *d.comparison.budget))))
    colours = {
        tick.get_text(): bar.get_facecolor()
        for tick, bar in zip(ax.get_yticklabels(), ax.patches, strict=True)
    }
    assert colours["gravity"] == colours["torque_ripple"] != colours["coulomb"]
