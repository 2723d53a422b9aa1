"""``lugrectl hunt``: exit codes, the JSON document and the picture."""

import json
from functools import partial

import pytest

import lugrectl as lg

from ..cases.quick_work import typed

run = partial(typed, command="hunt")
GAINS = "--kp 3 --ki 4 --kd 6"


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = {"J": 1.0, "Fc": 1.0, "Fv": 0.4}
    lg.write_model(lg.Model.of(friction="stribeck", Fs=1.5, vs=1e-3, **own), "sticks.toml")
    lg.write_model(lg.Model.of(friction="coulomb", **own), "smooth.toml")


def test_the_document_has_what_is_promised(files, capsys):
    line = f"--model sticks.toml {GAINS} --json --plot hunt.png"
    code, out, err = run(capsys, line)
    said = json.loads(out)
    assert code == 1 and said["schema"] == 1 and said["hunts"] is True and said["proof"] is None
    assert said["outcome"] == "hunts"
    (cycle,) = said["cycles"]
    assert {"amplitude", "period", "stable", "stops"} <= {*cycle} and cycle["stops"] == 2
    assert said["loop"]["ki"] == 4.0 and said["messages"] == []
    assert "picture: hunt.png" in err


@pytest.mark.slow
def test_the_speeds_of_a_moving_loop_are_answered_with_exit_0(files, capsys):
    code, out, _ = run(capsys, "--model sticks.toml --kp 3 --ki 4 --kd 6 --speed --json")
    said = json.loads(out)
    assert code == 0 and said["hunts"] is True and said["critical"] == {}
    assert 0.0 < said["stick_slip"]["speed_start"] and said["stick_slip"]["speed_end"] is not None


@pytest.mark.parametrize(
    ("line", "code", "outcome"),
    [
        ("--model smooth.toml", 0, "rests"),
        ("--model sticks.toml --rate 200 --time-limit 1e-6", 3, "undecided"),
    ],
)
def test_each_outcome_has_its_exit_code(files, capsys, line, code, outcome):
    done, out, _ = run(capsys, f"{line} {GAINS} --json")
    said = json.loads(out)
    assert done == code and said["outcome"] == outcome
    assert said["hunts"] is {"rests": False, "undecided": None}[outcome]
    assert outcome != "rests" or "Bisoffi" in said["proof"] and said["stick_slip"] is None


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [("--vary ki=1", 2, "ki=1:50"), ("--limit 0", 2, "--limit"),
     ("--speed --rate 100", 3, "continuous time")],
)  # fmt: skip
def test_what_cannot_be_answered_is_said(files, capsys, options, code, words):
    done, _, err = run(capsys, f"--model sticks.toml {GAINS} {options}")
    assert done == code and words in err
