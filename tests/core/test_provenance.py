"""A result says by what and from what it was computed."""

import hashlib
import pickle
from dataclasses import replace
from datetime import datetime, timedelta, timezone

import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.core import provenance
from lugrectl.core.provenance import SourceFile, stamp, stamped
from lugrectl.diagnosis.result import Diagnosis

from ..cases import quick_work
from ..cases.made_up import bare

files, job = quick_work.files, quick_work.job
NOON = datetime(2026, 3, 4, 12, 0, 5, tzinfo=timezone(timedelta(hours=2)))


@pytest.fixture
def noon(monkeypatch):
    monkeypatch.setattr(provenance, "now", lambda: NOON)


def sha(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def known(folder, *names):
    return [{"name": name, "sha256": sha(folder / name)} for name in names]


# --- files -------------------------------------------------------------------------------


def test_a_record_and_a_model_carry_the_file_that_was_read(files):
    record, model = lg.read_record("one.csv"), lg.read_model("model.toml")
    assert record.file == SourceFile("one.csv", sha(files / "one.csv"))
    assert record.file.path == "one.csv" and record.slice(0, 100).file == record.file
    assert model.file.sha256 == sha(files / "model.toml")
    assert pickle.loads(pickle.dumps(model)).file == model.file
    assert pickle.loads(pickle.dumps(record)).file == record.file


def test_a_changed_model_is_no_longer_that_of_the_file(files):
    model = lg.read_model("model.toml")
    assert model.with_values({"J": 1.0}).file is None
    assert model.with_effect("gravity").file is None
    assert replace(model, name="other").file is None


# --- stamps ------------------------------------------------------------------------------


def test_from_python_version_date_and_files_are_known(files, noon):
    @stamped("lugrectl.diagnose")
    def work(record, model, *, holdout=None):
        return Diagnosis("adequate")

    record, model = lg.read_record("one.csv"), lg.read_model("model.toml")
    made = work(record, model).summary()["provenance"]
    assert made == {
        "version": provenance.version(),
        "date": "2026-03-04T12:00:05+02:00",
        "command": "lugrectl.diagnose",
        "files": known(files, "one.csv", "model.toml"),
    }
    by_path = work("one.csv", model="model.toml", holdout="last")
    assert by_path.summary()["provenance"] == made
    twice = work([record, record], model, holdout=record)
    assert twice.summary()["provenance"] == made
    arrays = work(replace(record, file=None), lg.Model.of(lg.table1()))
    assert arrays.provenance.files == ()


def test_a_stamp_keeps_the_files_and_leaves_other_results_alone(files):
    first = stamp(bare(), "one", [files / "one.csv"])
    again = stamp(first, "two", [files / "model.toml"])
    assert again.provenance.command == "two" and again.provenance.files == first.provenance.files
    assert stamp({"a": 1}, "one") == {"a": 1}


# --- command line ------------------------------------------------------------------------


def run(capsys, *words):
    code = main(list(words))
    return code, capsys.readouterr().out


def test_the_same_input_gives_the_same_json_but_for_the_date(files, job, capsys, monkeypatch):
    words = ["diagnose", "one.csv", "--model", "model.toml", "--json"]
    made = []
    for year in (2026, 2031):
        date = NOON.replace(year=year)
        monkeypatch.setattr(provenance, "now", lambda date=date: date)
        made.append(run(capsys, *words)[1])
    assert made[0] != made[1] and made[0].replace("2026-", "2031-") == made[1]
