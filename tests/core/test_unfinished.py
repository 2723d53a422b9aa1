"""What a killed process was writing is gone after the next one has written there."""

import os
import subprocess
import sys

import pytest

from lugrectl.core.writing import write_together, write_whole
from lugrectl.engine.runtime.disk_cache import keep

KILLED = """
import os, sys
from pathlib import Path
from lugrectl.core.writing import unfinished
part = unfinished(Path(sys.argv[1]))
part.mkdir() if sys.argv[2] == "folder" else part.write_text("half")
os.kill(os.getpid(), 9)
"""
WAYS = {
    "model or picture": lambda folder: write_whole(folder / "m.toml", b"whole"),
    "code": lambda folder: keep(folder / "a.c", "whole"),
    "report": lambda folder: write_together({"a.html": "whole"}, folder, "{}"),
}


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize("kind", ["folder", "file"])
def test_whoever_writes_next_removes_what_a_killed_process_left(tmp_path, kind):
    for number, write in enumerate(WAYS.values()):
        folder = tmp_path / str(number)
        folder.mkdir()
        subprocess.run([sys.executable, "-c", KILLED, str(folder), kind])
        assert [p.name[:10] for p in folder.iterdir()] == [".lugrectl-"]
        write(folder)
        (made,) = folder.iterdir()
        assert made.read_text() == "whole"
