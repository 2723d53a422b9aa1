"""The command line: exit codes, one JSON document, sentences instead of tracebacks."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

from lugrectl.blocks.model import Model, read_model, table1
from lugrectl.cli import commands
from lugrectl.core.errors import InputError, Refused

from ..cases import quick_work
from ..cases.quick_work import typed as run

MODEL = Model.of(table1())
files, job = quick_work.files, quick_work.job


def one_document(text):
    def refuse(word):
        raise AssertionError(word)

    return json.loads(text, parse_constant=refuse)


# --- diagnose, identify, demo ------------------------------------------------------------


def test_record_options_reach_the_reader(files, job, capsys):
    text = (files / "one.csv").read_text()
    (files / "odd.csv").write_text(text.replace("t [s],u [N m],w [rad/s]", "a,b,c"))
    line = "diagnose odd.csv --model model.toml --columns t=a,u=b --columns w=c --units w=rpm"
    assert run(capsys, f"{line} --scale u=2")[0] == 0
    assert run(capsys, "diagnose one.csv --model model.toml")[0] == 0
    odd, plain = job.calls[0][0], job.calls[1][0]
    odd, plain = odd.channels, plain.channels
    assert np.allclose(odd["u"], 2 * plain["u"])
    assert np.allclose(odd["w"], plain["w"] * np.pi / 30)


def test_out_writes_the_three_files(files, job, capsys):
    code, out, err = run(capsys, "diagnose one.csv --model model.toml --json --out made/here")
    made = files / "made" / "here"
    assert code == 0 and one_document(out)["verdict"] == "found" and "report.html" in err
    assert {p.name for p in made.iterdir()} == {"report.html", "report.json", "model.toml"}
    assert one_document((made / "report.json").read_text())
    assert read_model(made / "model.toml").effects[0].block.name == "torque_ripple"


def test_demo_uses_what_ships_and_says_where_the_report_is(files, job, capsys, monkeypatch):
    (files / "demo").mkdir()
    shutil.copy("one.csv", files / "demo" / "record.csv")
    shutil.copy("model.toml", files / "demo" / "model.toml")
    monkeypatch.setattr(commands.resources, "files", lambda package: files)
    code, out, _ = run(capsys, "demo")
    assert code == 0 and out.startswith("found") and "lugrectl-demo" in out.splitlines()[-1]
    assert (files / "lugrectl-demo" / "report.html").exists()
    assert run(capsys, "demo --json --out other")[0] == 0 and (files / "other").is_dir()


# --- what can go wrong -------------------------------------------------------------------


def refused(line, capsys, code=2):
    """The one sentence that a failing command prints, on stderr only."""
    got, out, err = run(capsys, line)
    assert got == code and out == "" and "Traceback" not in err
    assert len(err.splitlines()) == 1
    return err


def test_a_record_that_cannot_answer_is_refused_and_its_report_has_no_model(files, job, capsys):
    job.answer = Refused("one.csv: u is constant.", "move the drive")
    code, out, err = run(capsys, "diagnose one.csv --model model.toml --json --out made")
    document = one_document(out)
    assert code == 3 and document["verdict"] == "refused" and len(err.splitlines()) == 2
    assert document["reason"] == "one.csv: u is constant."
    assert document["experiment"] == "move the drive" and document["record"]["samples"] == 2000
    assert one_document((files / "made" / "report.json").read_text()) == document
    assert "u is constant." in (files / "made" / "report.html").read_text()
    code, out, err = run(capsys, "diagnose one.csv --model model.toml --out more")
    assert code == 3 and out.startswith("refused") and "u is constant." in out and err == ""
    assert "report: more/report.html (and report.json)" in out
    assert {p.name for p in (files / "more").iterdir()} == {"report.html", "report.json"}


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("diagnose none.csv --model model.toml", "none.csv"),
        ("diagnose one.csv --model none.toml", "none.toml"),
        ("diagnose one.csv --model one.csv", "one.csv"),
        ("diagnose one.csv --model model.toml --units w=furlong", "furlong"),
        ("diagnose one.csv --model model.toml --columns nonsense", "nonsense"),
        ("diagnose one.csv --model model.toml --holdout none.csv", "none.csv"),
        ("diagnose one.csv one.csv --model model.toml", "twice"),
        ("diagnose one.csv --model model.toml --out one.csv", "not a folder"),
        ("diagnose one.csv --model model.toml --out .", "overwrite"),
    ],
)
def test_wrong_input_is_one_sentence(files, job, capsys, line, word):
    before = {p.name: p.read_bytes() for p in files.iterdir()}
    assert word in refused(line, capsys)
    assert not job.calls and {p.name: p.read_bytes() for p in files.iterdir()} == before


@pytest.mark.parametrize("how", ["path", "link"])
def test_the_holdout_must_not_be_a_training_file(files, job, capsys, how):
    name = {"path": "./one.csv", "link": "link.csv"}[how]
    if how == "link":
        (files / "link.csv").symlink_to("one.csv")
    line = f"diagnose two.csv one.csv --model model.toml --holdout {name}"
    assert "--holdout" in refused(line, capsys) and not job.calls
    assert run(capsys, "diagnose one.csv --model model.toml --holdout two.csv")[0] == 0


@pytest.mark.parametrize(
    "line",
    [
        "nonsense",
        "diagnose",
        "diagnose one.csv",
        "diagnose one.csv --mod model.toml",
        "diagnose one.csv --model model.toml --rate fast",
        "diagnose one.csv --model model.toml --horizon 0",
        "diagnose one.csv --model model.toml --seed -1",
        "check",
        "check h-infinity",
        "check spr --kp nan",
        "check spr --position --velocity",
    ],
)
def test_wrong_usage_exits_2(files, job, capsys, line):
    code, out, err = run(capsys, line)
    assert code == 2 and out == "" and "lugrectl" in err.splitlines()[-1]


def test_a_misspelt_option_is_named_with_its_command(files, job, capsys):
    code, out, err = run(capsys, "diagnose one.csv --model model.toml --hold last")
    assert code == 2 and out == "" and not job.calls
    assert err.splitlines()[-1].startswith("lugrectl diagnose: error: there is no option")
    assert "did you mean --holdout?" in err
    code, out, err = run(capsys, "effects --nothing-like-it")
    assert code == 2 and "did you mean" not in err


def test_errors_of_the_work(files, job, capsys, monkeypatch):
    line = "diagnose one.csv --model model.toml --json"
    job.answer = InputError("model.toml: J is missing.")
    assert "J is missing." in refused(line, capsys)
    job.answer = KeyboardInterrupt()
    assert "interrupted" in refused(line, capsys, 130)
    job.answer = ZeroDivisionError("by\nnothing")
    assert "ZeroDivisionError: by nothing" in refused(line, capsys, 70)
    monkeypatch.setenv("LUGRECTL_DEBUG", "1")
    assert "Traceback" in run(capsys, line)[2]


def test_a_reader_that_leaves_a_pipe_is_no_error():
    command = [sys.executable, "-m", "lugrectl", "effects"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b"" and process.wait(60) == 141


# --- template ------------------------------------------------------------------


def test_the_model_template_can_be_read_as_it_is_and_filled_in(files, capsys):
    code, out, _ = run(capsys, "model")
    (files / "my.toml").write_text(out)
    model = read_model(files / "my.toml")
    assert code == 0 and all(v is None for v in model.values().values())
    assert one_document(run(capsys, "model --json")[1])["toml"].strip() == out.strip()
    filled = [
        line.removeprefix("# ") if " = " in line or "[[" in line else line
        for line in out.splitlines()
        if not line.startswith("# Effects")
    ]
    (files / "full.toml").write_text("\n".join(filled))
    model = read_model(files / "full.toml")
    assert model.values() == MODEL.values() | {"gravity.amplitude": 0.2, "gravity.phase": 0.0}


def test_help_loads_no_numerics():
    """It answers at once."""
    code = [
        "import sys",
        "from lugrectl.cli import main",
        "try: main(['--help'])",
        "except SystemExit: pass",
        "sys.exit('numpy' in sys.modules)",
    ]
    made = subprocess.run([sys.executable, "-c", "\n".join(code)], capture_output=True, text=True)
    assert made.returncode == 0 and "usage: lugrectl" in made.stdout
