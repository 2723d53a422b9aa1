"""Many logs at once: what becomes of each, tables, names, files, other processes."""

import json
import os
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY, P
from lugrectl.blocks.model import Sent
from lugrectl.core.errors import InputError, Refused
from lugrectl.diagnosis import fleet as fleet_module
from lugrectl.diagnosis.fleet import Outcome
from lugrectl.diagnosis.result import VERDICTS
from lugrectl.record.as_record import record_files
from lugrectl.report import fleet_page

from ..cases.html_page import Page
from ..cases.logs import csv as log
from ..cases.made_up import HOSTILE, answered, bare

MODEL = lg.Model.of(lg.table1())


@pytest.fixture
def job(monkeypatch):
    """Stands for lugrectl.diagnose: answers by the name of the log, and notes the calls."""
    fake = SimpleNamespace()

    def work(record, model, *, holdout=None, horizon=1.0, seed=0, progress=None, **more):
        fake.calls.append((record, {"holdout": holdout, "horizon": horizon, "seed": seed}))
        if progress:
            progress(0.5, "half")
        answer = fake.answers.get(record.source.split(".")[0], "found")
        return answered(bare(answer) if isinstance(answer, str) else answer, record, model)

    fake.calls, fake.answers = [], {}
    monkeypatch.setattr(fleet_module, "diagnose", work)
    return fake


@pytest.fixture
def logs(tmp_path):
    """A folder of four logs, the last one unreadable."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for name in ("axis1", "axis2", "axis10"):
        log(folder, name=f"{name}.csv")
    (folder / "empty.csv").write_text("")
    (folder / "notes.txt").write_text("mine")
    return folder


OPTIONS = {"holdout": None, "horizon": 1.0, "seed": 0}


def refuse(word):
    raise AssertionError(word)


# --- what becomes of each ----------------------------------------------------------------


def test_every_log_gets_its_own_answer(logs, job):
    job.answers = {"axis2": "adequate", "axis10": Refused("u is constant.", "move it")}
    fleet = lg.diagnose_each(logs, MODEL, holdout="last", horizon=0.5, rate=1000.0)
    names = ["axis1.csv", "axis2.csv", "axis10.csv", "empty.csv"]
    assert [row["file"] for row in fleet.rows] == [str(logs / name) for name in names]
    assert [o.exit_code for o in fleet.outcomes] == [0, 0, 3, 2] and fleet.exit_code == 3
    wanted = dict.fromkeys(VERDICTS, 0) | {"found": 1, "adequate": 1, "refused": 1, "failed": 1}
    assert fleet.counts == wanted
    assert list(fleet.failed) == [str(logs / "empty.csv")] and not fleet.unfinished
    assert [d.verdict for d in fleet.diagnoses.values()] == ["found", "adequate", "refused"]
    assert job.calls[0][1] == {"holdout": "last", "horizon": 0.5, "seed": 0}


def test_the_document_holds_each_diagnosis_or_a_reason(logs, job):
    job.answers = {"axis2": Refused("u is constant."), "axis10": ZeroDivisionError("by\nzero")}
    fleet = lg.diagnose_each(logs, MODEL, keep=False)
    document = json.loads(fleet.to_json(), parse_constant=refuse)
    assert document["schema"] == 1 and document["counts"]["failed"] == 2
    found, refused, broken, empty = document["records"]
    assert found["diagnosis"] | {"provenance": None} == bare().summary()
    assert found["reason"] is None
    assert refused["diagnosis"]["verdict"] == "refused" and refused["reason"] == "u is constant."
    assert refused["diagnosis"]["record"]["samples"] == 3000
    assert broken["diagnosis"] is None and broken["reason"] == "ZeroDivisionError: by zero"
    assert [r["exit_code"] for r in document["records"]] == [0, 3, 70, 2]
    assert "empty" in empty["reason"] and not fleet.diagnoses


def test_an_interrupt_keeps_what_is_done(logs, job):
    job.answers = {"axis2": KeyboardInterrupt()}
    fleet = lg.diagnose_each(logs, MODEL)
    assert list(fleet.diagnoses) == [str(logs / "axis1.csv")]
    names = [Path(file).name for file in fleet.unfinished]
    assert names == ["axis2.csv", "axis10.csv", "empty.csv"]
    assert "3 of 4 not" in str(fleet) and "axis10.csv" in fleet._repr_html_()


def test_progress_runs_over_all_logs(logs, job):
    said = []
    lg.diagnose_each(logs, MODEL, progress=lambda fraction, what: said.append((fraction, what)))
    fractions = [fraction for fraction, _ in said]
    assert fractions == sorted(fractions) and fractions[0] == 0.0 and fractions[-1] == 1.0
    assert (0.375, "2 of 4: half") in said


def test_what_is_asked_wrongly_is_said_before_any_work(logs, job):
    with pytest.raises(InputError, match="holdout"):
        lg.diagnose_each(logs, MODEL, holdout=str(logs / "axis1.csv"))
    with pytest.raises(TypeError, match="horizn"):
        lg.diagnose_each(logs, MODEL, horizn=1.0)
    with pytest.raises(InputError, match="no record"):
        lg.diagnose_each([], MODEL)
    with pytest.raises(InputError, match="jobs must be a whole number"):
        lg.diagnose_each(logs, MODEL, jobs=0)
    assert not job.calls


# --- which files -------------------------------------------------------------------------


def test_folders_and_patterns_stand_for_files(logs, monkeypatch):
    monkeypatch.chdir(logs)
    (logs / "sub").mkdir()
    for name in ("b.MAT", ".hidden.csv", "sub/c.npz", "odd[1].csv"):
        (logs / name).write_text("x")

    def names(*given):
        return [str(file) for file in record_files(given)]

    assert names(".") == "axis1.csv axis2.csv axis10.csv b.MAT empty.csv odd[1].csv".split()
    assert names("axis*.csv") == ["axis1.csv", "axis2.csv", "axis10.csv"]
    assert names("**/*.npz") == [os.path.join("sub", "c.npz")] == names("su?")
    assert names("axis2.csv", "axis?.csv", "./axis1.csv") == ["axis2.csv", "axis1.csv"]
    assert names("odd[1].csv", "none.csv") == ["odd[1].csv", "none.csv"]
    (logs / "bare").mkdir()
    for wrong in ("bare", "nothing*.csv"):
        with pytest.raises(InputError, match=wrong.rstrip("*.csv")):
            names("axis1.csv", wrong)


# --- tables ------------------------------------------------------------------------------


def fleet_of(*verdicts, names=None):
    files = names or [f"logs/{i}.csv" for i, _ in enumerate(verdicts)]
    outcomes = [
        Outcome(file, 2, reason=f"{file} is empty.")
        if verdict == "failed"
        else Outcome(file, 0, 1.5, bare(verdict).summary(), bare(verdict).reason)
        for file, verdict in zip(files, verdicts, strict=True)
    ]
    return lg.Fleet(tuple(outcomes), model=MODEL)


def test_text_has_counts_first_and_a_line_and_more_for_each_log():
    said = str(fleet_of("found", "ambiguous", "unexplained", "adequate", "refused", "failed"))
    lines = said.splitlines()
    assert lines[0] == (
        "6 logs: 1 adequate, 1 found, 1 ambiguous, 1 unexplained, 1 refused, 1 failed"
    )
    assert max(map(len, lines)) <= 80 and "None" not in said and "nan" not in said
    found = {line.split()[1]: line for line in lines if ".csv: " in line}
    assert "torque_ripple: amplitude 0.0501 N m" in found["0.csv:"]
    assert "or periodic_disturbance" in said and said.count("or periodic_disturbance") == 1
    assert "depends on theta" in found["2.csv:"] and "u is constant." in found["4.csv:"]
    assert "logs/5.csv is empty." in found["5.csv:"]


def test_the_page_is_whole_safe_and_links_what_was_written():
    names = [f"{HOSTILE}", "logs/b #1.csv", "logs/c.csv"]
    fleet = fleet_of("found", "adequate", "failed", names=names)
    page = Page(fleet_page.page(fleet, {names[1]: "b #1/report.html"}).html())
    links = [value for key, value in page.attributes if key == "href"]
    assert links == ["b%20%231/report.html"]
    assert "script" not in page.tags and HOSTILE in page.said
    fragment = Page(fleet._repr_html_())
    assert "html" not in fragment.tags and "a" not in fragment.tags


PART = st.sampled_from(["a", "A", "b", "run", "index.html", "..", "a.b", "a-b"])
FILE = st.lists(PART, min_size=1, max_size=3).map("/".join)


@given(st.lists(FILE.map(lambda name: f"{name}.csv"), max_size=8, unique=True))
def test_each_log_has_a_folder_of_its_own(files):
    names = fleet_page.folder_names(files)
    used = {name.casefold() for name in names} | set(fleet_page.INDEX)
    assert len(used) == len(files) + len(fleet_page.INDEX)
    assert all(name and name == os.path.basename(name) and name != ".." for name in names)


def test_folders_say_which_log():
    files = [f"logs/{name}" for name in ("left/run.csv", "right/run.csv", "axis.csv", "axis.mat")]
    assert fleet_page.folder_names(files) == ["run", "run-2", "axis", "axis-2"]
    assert fleet_page.folder_names(["/x/a.csv", "b.csv"]) == ["a", "b"]


# --- other processes ---------------------------------------------------------------------


@pytest.mark.slow
def test_processes_give_what_one_gives_and_read_themselves(logs):
    """Logs too short to be diagnosed, so that it is quick."""
    for name in ("axis1", "axis2", "axis10"):
        log(logs, name=f"{name}.csv", keep=slice(0, 30))
    alone = lg.diagnose_each(logs, MODEL).summary()
    spread = lg.diagnose_each(logs, MODEL, jobs=2).summary()
    for record in (*alone["records"], *spread["records"]):
        record.pop("seconds")
        if record["diagnosis"]:
            record["diagnosis"]["plain"].pop("seconds")
            assert record["diagnosis"]["provenance"].pop("date")
    assert alone["provenance"].pop("date") and spread["provenance"].pop("date")
    assert alone == spread and alone["counts"]["refused"] == 3


def test_any_executor_carries_the_work(logs, job):
    with ThreadPoolExecutor(2) as pool:
        fleet = lg.diagnose_each(logs, MODEL, executor=pool)
    assert fleet.counts["found"] == 3 and len(job.calls) == 3


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ({"law": "lugree"}, "there is no friction law named 'lugree'; did you mean 'lugre'"),
        ({"time_limit": -1.0}, "time_limit"),
        ({"alpha": 2.0}, "alpha is 2"),
        ({"least": 0.0}, "least"),
    ],
)
def test_an_option_that_cannot_be_meant_is_said_once_before_any_log_is_read(logs, option, said):
    with pytest.raises(lg.InputError, match=said):
        lg.diagnose_each(logs, MODEL, **option)


def test_an_effect_that_the_workers_do_not_know_is_said_and_not_left_out():
    def spring_of_mine(theta, stiffness=P(0.0, "N m/rad", 0.0, neutral=0.0)):
        """r_e = k theta."""
        return stiffness * theta

    made = lg.block("effect", out="d", acts="torque")(spring_of_mine)
    try:
        sent, whole = Sent.of(MODEL), pickle.dumps(made)
        assert sent.open() == MODEL and pickle.loads(whole) is made
    finally:
        del REGISTRY["effect", "spring_of_mine"]
    with pytest.raises(InputError, match="spring_of_mine.*jobs=1"):
        sent.open()
    with pytest.raises(InputError, match="spring_of_mine"):
        pickle.loads(whole)
