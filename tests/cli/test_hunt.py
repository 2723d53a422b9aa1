"""``lugrectl hunt`` over a model: three outcomes and their exit codes."""

import json

import pytest

from lugrectl.cli import main

MODEL = """
[plant]
J = 1.0
[friction]
model = "stribeck"
Fc = 1.0
Fs = {Fs}
Fv = 0.4
vs = 1e-3
"""


@pytest.mark.parametrize(
    ("Fs", "more", "code", "outcome"),
    [
        (1.0, (), 0, "rests"),
        (1.5, (), 1, "hunts"),
        (1.5, ("--rate", "200", "--time-limit", "1e-6"), 3, "undecided"),
    ],
)
def test_each_outcome_has_its_exit_code(tmp_path, capsys, Fs, more, code, outcome):
    path = tmp_path / "drive.toml"
    path.write_text(MODEL.format(Fs=Fs))
    line = ["hunt", "--model", str(path), "--kp", "3", "--ki", "4", "--kd", "6", *more, "--json"]
    assert main(line) == code
    said = json.loads(capsys.readouterr().out)
    assert said["outcome"] == outcome and said["schema"] == 1
    assert said["hunts"] is {"rests": False, "hunts": True, "undecided": None}[outcome]
    assert bool(said["cycles"]) == (outcome == "hunts")


def test_a_limit_of_no_torque_is_refused(tmp_path, capsys):
    path = tmp_path / "drive.toml"
    path.write_text(MODEL.format(Fs=1.5))
    assert main(["hunt", "--model", str(path), "--limit", "0"]) == 2
    assert "--limit" in capsys.readouterr().err
