"""``lugrectl assure`` and ``lugrectl hunt`` over a report."""

import json
from pathlib import Path

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    t = 2e-3 * np.arange(2000)
    w = 3.0 * np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    folder = tmp_path_factory.mktemp("report")
    fit.save(folder)
    return str(folder / "report.json")


def run(capsys, *words):
    code = main([*words])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_answer_in_words_and_as_a_picture(report, capsys, tmp_path):
    picture = tmp_path / "dare.png"
    line = ("--loop", "velocity", "--members", "2", "--plot", str(picture))
    code, out, err = run(capsys, "assure", report, *line)
    assert code == 0 and out.startswith("Assurance: compensate ") and "2 members" in out
    assert "picture:" in err and picture.stat().st_size > 1000


def test_the_document(report, capsys):
    line = ("--loop", "velocity", "--members", "3", "--observer", "extended_state", "--json")
    code, out, _ = run(capsys, "assure", report, *line)
    said = json.loads(out)
    assert code == 0 and said["schema"] == 1 and said["members"] == 3
    assert set(said["worse"]) == {"value", "ci95", "count", "members"}
    assert {"scale", "observer", "gains", "error", "band", "bound", "hunts"} <= set(said)


def test_wrong_usage_exits_2(report, capsys, tmp_path):
    other = tmp_path / "other.json"
    other.write_text("{}")
    for words in (("nowhere.json",), (str(other),), (report, "--frequency", "900")):
        code, out, err = run(capsys, "assure", *words)
        assert code == 2 and not out and err.startswith("lugrectl: ")


def test_a_value_that_is_not_known_exits_3(report, capsys, tmp_path):
    said = json.loads(Path(report).read_text())
    for key in ("names", "values", "positive"):
        said["members"][0][key].pop()
    said["members"][0]["matrix"] = np.array(said["members"][0]["matrix"])[:-1, :-1].tolist()
    part = tmp_path / "part.json"
    part.write_text(json.dumps(said))
    code, out, err = run(capsys, "assure", str(part))
    assert code == 3 and not out and "does not determine Fv" in err


@pytest.mark.slow
def test_the_chance_of_hunting_exits_1_where_a_member_hunts(report, capsys):
    line = ("hunt", "--report", report, "--members", "2", "--kp", "2", "--ki", "500", "--json")
    code, out, _ = run(capsys, *line)
    assert code == 1 and json.loads(out)["chance"]["count"] == 2
