"""What users type and get back stays: nothing of ``face.txt`` changes without being meant."""

import pytest

from . import face


@pytest.fixture(scope="module")
def lines():
    return face.lines()


def test_the_face_is_as_written(lines):
    written = face.FILE.read_text().splitlines()
    gone, new = sorted({*written} - {*lines}), sorted({*lines} - {*written})
    assert not gone and not new, f"python -m tests.house.face, if meant; {gone=}, {new=}"


@pytest.mark.parametrize("start", ["lg.", "results.", "effects: ", "command ", "exit ", "json "])
def test_each_kind_is_seen(lines, start):
    assert sum(line.startswith(start) for line in lines) >= 10


def test_the_demo_names_the_effect_and_reaches_the_noise():
    code, answer, files = face.done("demo")
    error = answer["error"]
    assert code == 0 and answer["verdict"] == "found"
    assert error["augmented"] <= 1.2 * error["noise_floor"] < 0.1 * error["refitted"]
    assert {*files} - {"short.csv"} == {"model.toml", "report.html", "report.json"}
    assert files["report.html"] > 10_000
