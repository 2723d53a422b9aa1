"""Files given in the wrong place: a model as a log, a log as the model."""

import pytest

import lugrectl as lg
from lugrectl.cli import main

from ..cases.logs import csv

SWAP = "my.toml is a model and run.csv is a log: swap them."


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    csv(tmp_path)
    (tmp_path / "my.toml").write_text("plant.J = 0.002\n")


def said(capsys, *args):
    """The sentence of a command that leaves with 2; argparse leaves by itself."""
    try:
        code = main([*args])
    except SystemExit as out:
        code = out.code
    printed = capsys.readouterr()
    assert code == 2 and printed.out == "" and printed.err.count("\n") == 1
    return printed.err


@pytest.mark.parametrize("command", ["diagnose", "identify", "plot", "diagnose --each"])
def test_a_model_and_a_log_that_were_swapped_are_named(files, capsys, command):
    assert SWAP in said(capsys, *command.split(), "my.toml", "--model", "run.csv")


def test_a_swapped_pair_is_named_in_python(files):
    with pytest.raises(lg.InputError, match=SWAP):
        lg.diagnose("my.toml", "run.csv")


@pytest.mark.parametrize("command", ["plot my.toml", "identify my.toml --model my.toml"])
def test_a_model_as_a_log_is_named(files, capsys, command):
    assert "my.toml is a model file, not a log" in said(capsys, *command.split())


def test_a_log_as_the_model_is_told_what_a_model_is(files, capsys):
    text = said(capsys, "diagnose", "run.csv", "--model", "run.csv")
    assert "run.csv: not a TOML file" in text and "A model is needed here" in text


def test_a_model_among_the_logs_is_what_the_missing_option_needs(files, capsys):
    assert "(give --model my.toml)" in said(capsys, "diagnose", "run.csv", "my.toml")
