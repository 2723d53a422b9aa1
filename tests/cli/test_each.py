"""lugrectl diagnose --each: options, exit codes, files, interrupt."""

import json
from types import SimpleNamespace

import pytest

from lugrectl import report
from lugrectl.blocks.model import Model, table1, write_model
from lugrectl.cli import commands, main
from lugrectl.core.errors import InputError
from lugrectl.report import FILES, fleet_page

from ..cases.logs import csv as log
from ..cases.made_up import answered, bare


@pytest.fixture
def job(monkeypatch):
    """Stands for the diagnosis, in this process; ``answers`` by the name of the log."""
    fake = SimpleNamespace()

    def work(record, model, **options):
        fake.calls.append(options)
        answer = fake.answers.get(record.source, "found")
        return answered(bare(answer) if isinstance(answer, str) else answer, record, model)

    fake.calls, fake.answers = [], {}
    for home in ("fleet", "diagnose"):
        monkeypatch.setattr(f"lugrectl.diagnosis.{home}.diagnose", work)
    monkeypatch.setattr(commands, "processors", lambda: 1)
    return fake


@pytest.fixture
def files(tmp_path, monkeypatch):
    """The working directory: a model, and logs in two folders, two of one name."""
    for name in ("left/run.csv", "right/run.csv", "right/axis.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        log(tmp_path, name=name)
    write_model(Model.of(table1()), tmp_path / "model.toml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys, line):
    code = main(f"diagnose {line} --model model.toml".split())
    streams = capsys.readouterr()
    return code, streams.out, streams.err


def listed(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_one_table_of_all_logs(files, job, capsys):
    job.answers["axis.csv"] = "adequate"
    code, out, err = run(capsys, "left right --each --holdout last --seed 3")
    assert code == 0 and err == "" and out.startswith("3 logs: 1 adequate, 2 found\n")
    for name in ("left/run.csv", "right/run.csv", "right/axis.csv"):
        assert name in out
    assert {k: job.calls[0][k] for k in ("holdout", "horizon", "seed")} == {
        "holdout": "last",
        "horizon": 1.0,
        "seed": 3,
    }


def test_out_holds_a_folder_per_log_and_an_index(files, job, capsys):
    code, out, err = run(capsys, "left right --each --out made --json")
    assert code == 0 and json.loads(out)["counts"]["found"] == 3 and "made/index.html" in err
    reports = [f"{log}/{name}" for log in ("axis", "run", "run-2") for name in FILES]
    assert listed(files / "made") == sorted([*reports, *fleet_page.INDEX])
    page = (files / "made" / "index.html").read_text()
    assert all(f'href="{log}/report.html"' in page for log in ("axis", "run", "run-2"))


@pytest.mark.slow
def test_the_exit_code_is_the_highest_after_all_were_done(files, job, capsys):
    (files / "right" / "empty.csv").write_text("")
    code, out, err = run(capsys, "right left none.csv --each --json")
    document = json.loads(out)
    assert code == 2 and [r["exit_code"] for r in document["records"]] == [0, 2, 0, 0, 2]
    assert err == ""
    job.answers["axis.csv"] = "refused"
    code, out, err = run(capsys, "right left --each --out made")
    assert code == 3 and err == "" and "u is constant." in out
    assert listed(files / "made" / "axis") == ["report.html", "report.json"]
    assert listed(files / "made" / "run") == sorted(FILES)
    assert 'href="axis/report.html"' in (files / "made" / "index.html").read_text()
    job.answers["axis.csv"] = ZeroDivisionError("x")
    code, out, err = run(capsys, "right left --each")
    assert code == 70 and "LUGRECTL_DEBUG" in err and "ZeroDivisionError: x" in out


def test_an_interrupt_prints_and_writes_what_is_done(files, job, capsys):
    job.answers["axis.csv"] = KeyboardInterrupt()
    code, out, err = run(capsys, "left/run.csv right/axis.csv --each --out made")
    assert code == 130 and out.startswith("1 log: 1 found") and "1 of 2 not" in out
    assert err == "lugrectl: interrupted: 1 of 2 logs done.\n"
    reports = [f"run/{name}" for name in FILES]
    assert listed(files / "made") == sorted([*reports, *fleet_page.INDEX])
    code, out, _ = run(capsys, "right/axis.csv left/run.csv --each --out new --json")
    document = json.loads(out)
    assert code == 130 and document["records"] == [] and len(document["unfinished"]) == 2
    assert not (files / "new").exists()


def test_a_report_that_cannot_be_written_costs_no_answer(files, job, capsys, monkeypatch):
    whole = report.write_together

    def full(content, folder, complaint):
        if folder.name == "axis":
            raise InputError(f"{folder}: {complaint.format('No space left on device')}")
        whole(content, folder, complaint)

    monkeypatch.setattr(report, "write_together", full)
    code, out, _ = run(capsys, "right --each --out made")
    assert code == 2 and out.startswith("2 logs: 2 found") and "No space left" in out
    assert 'href="run/report.html"' in (files / "made" / "index.html").read_text()
    assert 'href="axis' not in (files / "made" / "index.html").read_text()
    monkeypatch.setattr(fleet_page, "write_index", _raises)
    code, out, err = run(capsys, "right --each --out made")
    assert code == 2 and out.startswith("2 logs") and "disk" in err


def _raises(*_):
    raise InputError("the disk is full.")


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("left --each --holdout right/run.csv", "--holdout last"),
        ("left/run.csv --jobs 2", "--each"),
        ("left --each --jobs 0", "at least 1"),
        ("left --each --jobs -2", "at least 1"),
        ("left --each --jobs many", "at least 1"),
        ("left nothing*.csv --each", "matches no file"),
        ("bare --each", "holds no record"),
        ("left --each --units nonsense", "nonsense"),
        ("left --each --out left", "summary.csv"),
        ("left --each --out model.toml", "not a folder"),
    ],
)
def test_wrong_usage_is_a_sentence_and_no_work(files, job, capsys, line, word):
    (files / "bare").mkdir()
    before = listed(files)
    code, out, err = run(capsys, line)
    assert code == 2 and out == "" and word in err.splitlines()[-1]
    assert not job.calls and listed(files) == before


def test_patterns_that_the_shell_left_are_expanded(files, job, capsys):
    assert run(capsys, "r*/*.csv --each")[1].startswith("2 logs")
    assert run(capsys, "right/a*.csv")[0] == 0 and len(job.calls) == 3


def test_a_folder_stands_for_the_runs_of_one_drive_in_it(files, job, capsys):
    assert run(capsys, "left")[0] == 0 and len(job.calls) == 1
