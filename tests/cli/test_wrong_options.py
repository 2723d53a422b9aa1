"""Options that contradict each other are one sentence, before anything is read or computed."""

import pytest

from lugrectl.cli import main

PLAN = ["bode", "--model", "my.toml", "--plan", "excitation.csv"]
HUNT = ["hunt", "--kp", "2"]


@pytest.mark.parametrize(
    "command, code, words",
    [
        ([*PLAN, "--rate", "1000", "--limits", "w=fast,u=3"], 2, "--limits is 'w=fast,u=3'"),
        ([*PLAN, "--limits", "w=60,u=3"], 2, "needs the rate and the limits"),
        ([*PLAN, "--rate", "1000", "--limits", "w=60,u=3", "--tune", "PI"], 2, "--plan writes"),
        ([*HUNT, "--model", "my.toml", "--vary", "ki=1"], 2, "--vary is 'ki=1'"),
        ([*HUNT, "--report", "report.json", "--vary", "ki=1:50"], 2, "--vary is for one drive"),
        ([*HUNT, "--report", "report.json", "--speed"], 2, "--speed is for one drive"),
        ([*HUNT, "--model", "my.toml", "--speed", "--rate", "1000"], 3, "continuous time"),
    ],
)
def test_they_are_refused(command, code, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(command) == code
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said and not list(tmp_path.iterdir())
