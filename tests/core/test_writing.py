"""A report is written whole or not at all, whatever happens to the process or the disk."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest

import lugrectl as lg
from lugrectl.core import writing
from lugrectl.report import FILES, check_folder

from ..cases.made_up import bare

resource = pytest.importorskip("resource", reason="needs limits of processes")
posix = pytest.mark.skipif(os.name != "posix", reason="needs signals and limits of processes")


def hidden(folder):
    return [p.name for p in folder.iterdir() if p.name.startswith(".lugrectl-")]


WRITER = """
import os, sys
from pathlib import Path

from lugrectl.core.writing import write_together

stop, folder, seen = int(sys.argv[1]), Path(sys.argv[2]), 0

def counted(call):
    def run(*given, **more):
        global seen
        seen += 1
        if seen > stop:
            os.kill(os.getpid(), 9)
        return call(*given, **more)
    return run

os.replace = counted(os.replace)
Path.rename, Path.mkdir = counted(Path.rename), counted(Path.mkdir)
Path.write_text = counted(Path.write_text)
write_together({"a": "new a", "b": "new b", "c": "new c"}, folder, "{}")
print("done")
"""


@posix
@pytest.mark.cases
@pytest.mark.parametrize("there", [True, False], ids=["over an old report", "new folder"])
def test_a_process_killed_at_any_step_of_the_writing_never_mixes_two_runs(tmp_path, there):
    made = []
    for stop in range(14):
        out = tmp_path / f"out{stop}"
        if there:
            out.mkdir()
            for name in "abc":
                (out / name).write_text(f"old {name}")
            (out / "mine").write_text("kept")
        run = [sys.executable, "-c", WRITER, str(stop), str(out)]
        done = subprocess.run(run, capture_output=True, text=True)
        assert done.returncode in (0, -signal.SIGKILL), done.stderr
        texts = {n: (out / n).read_text() for n in "abc" if (out / n).exists()}
        assert len({text.split()[0] for text in texts.values()}) <= 1
        assert "a" not in texts or len(texts) == 3
        assert not there or (out / "mine").read_text() == "kept"
        made.append((done.returncode, "new" in str(texts)))
        writing.write_together({"a": "2 a", "b": "2 b", "c": "2 c"}, out, "{}")
        assert [(out / n).read_text() for n in "abc"] == ["2 a", "2 b", "2 c"]
        if done.returncode == 0:
            break
    assert made[0] == (-signal.SIGKILL, False) and made[-1] == (0, True)


@contextmanager
def full(size):
    """A disk on which no file can be larger than this."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@posix
@pytest.mark.parametrize("size", [0, 1000, 4000])
@pytest.mark.parametrize("there", [False, True])
def test_a_full_disk_is_one_sentence_and_leaves_what_was_there(tmp_path, size, there):
    out = tmp_path / "out"
    if there:
        out.mkdir()
        for name in FILES:
            (out / name).write_text("old")
    made = bare()
    with pytest.raises(lg.InputError) as said, full(size):
        made.save(out)
    assert "the report cannot be written there (File too large)" in str(said.value)
    assert str(out) in str(said.value) and "\n" not in str(said.value)
    texts = {p.name: p.read_text() for p in out.iterdir()} if there else {}
    assert texts == (dict.fromkeys(FILES, "old") if there else {})
    assert there or not out.exists()
    assert hidden(tmp_path) == []


@posix
def test_a_full_disk_is_one_sentence_for_models_and_pictures_too(tmp_path):
    model = lg.Model.of(lg.table1())
    lg.write_model({"J": 0.001}, tmp_path / "m.toml")
    before = (tmp_path / "m.toml").read_text()
    with full(20):
        with pytest.raises(lg.InputError, match="m.toml cannot be written: File too large"):
            lg.write_model(model, tmp_path / "m.toml")
        with pytest.raises(lg.InputError, match="picture.png cannot be written"):
            writing.write_whole(tmp_path / "picture.png", b"a" * 100, "--plot")
    assert (tmp_path / "m.toml").read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.toml"]


def test_a_folder_that_only_reads_is_one_sentence(tmp_path, monkeypatch):
    def refuse(self, *given, **more):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(writing.Path, "mkdir", refuse)
    with pytest.raises(lg.InputError, match=r"cannot be written there \(Permission denied\)"):
        bare().save(tmp_path)
    monkeypatch.undo()
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(lg.InputError, match="no permission to write there"):
        check_folder(tmp_path)
