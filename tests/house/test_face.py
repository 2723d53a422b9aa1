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
