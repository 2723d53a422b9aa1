"""What is loaded from the cache is checked: damaged code is built again, planted code never run."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lugrectl.engine.runtime import backend
from lugrectl.engine.runtime.backend import SUFFIX, Native, has_compiler

ROOT = "def run(a):\n    a[0] = sqrt(a[0]) + {}\n"
USE = """
import numpy as np, lugrectl as lg
z = lg.deflection(np.sin(np.arange(5000) * 1e-3), 1e-3, lg.table1())
r = lg.simulate(lg.velocity_loop(lg.table1()), np.arange(0, 0.1, 1e-3), 0.1)
print(float(z[-1]), float(r.outputs[1, -1]))
"""
needs_c = pytest.mark.skipif(not has_compiler(), reason="there is no C compiler")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    path = tmp_path / "cache"
    monkeypatch.setenv("LUGRECTL_CACHE", str(path))
    return path


def answer(number):
    there = np.array([4.0])
    Native(ROOT.format(number))(there)
    return there[0]


@needs_c
@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 3], lambda b: b"", lambda b: b[::-1]])
def test_a_damaged_library_is_built_again(folder, damage):
    assert answer(1.5) == 3.5
    made = next(folder.glob(f"*{SUFFIX}"))
    sound = made.read_bytes()
    copy = made.with_name("copy")  # what is loaded must not change under the process
    copy.write_bytes(damage(sound))
    os.replace(copy, made)
    assert not backend.is_sound(made)
    assert answer(1.5) == 3.5 and backend.is_sound(made)


@needs_c
@pytest.mark.skipif(os.name != "posix", reason="folders have no owner here")
def test_a_folder_that_others_may_write_is_not_used(folder):
    folder.mkdir()
    folder.chmod(0o777)
    assert answer(2.5) == 4.5
    assert not list(folder.iterdir()) and list(Path(f"{folder}-own").glob("*.c"))


@needs_c
def test_a_full_disk_costs_the_cache_and_nothing_else(folder, monkeypatch):
    usual = backend.keep

    def full(path, text):
        if folder in path.parents:
            raise OSError(28, "No space left on device")
        usual(path, text)

    monkeypatch.setattr(backend, "keep", full)
    assert answer(3.5) == 5.5


@pytest.mark.parametrize("kind", [pytest.param("c", marks=needs_c), "numba"])
def test_where_nothing_can_be_written_code_runs_as_plain_python(folder, monkeypatch, kind):
    """Cache and temporary folder full: one warning for as many loops as there are."""

    def full(path, text):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(backend, "keep", full)
    backend._say_once.cache_clear()
    with pytest.warns(RuntimeWarning, match=r"plain Python.*No space left on device") as said:
        for number in (3.25, 4.25):
            there = np.array([4.0])
            backend.load(f"@fast\n{ROOT.format(number)}", kind).run(there)
            assert there[0] == 2.0 + number
    assert len(said) == 1


def test_a_cache_that_cannot_be_written_is_replaced(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LUGRECTL_CACHE", str(tmp_path / "file" / "below"))
    assert backend.cache_dir().is_dir()


def test_a_full_cache_drops_its_older_half_with_the_libraries(tmp_path):
    for age, name in enumerate("a.c b.py c.c d.py".split()):
        for file in (f"lugrectl_{name}", f"lugrectl_{name[0]}.so"):
            (tmp_path / file).write_text("")
            os.utime(tmp_path / file, (age, age))
    backend.make_room(tmp_path, most=4)
    left = sorted(p.name for p in tmp_path.iterdir())
    assert left == ["lugrectl_c.c", "lugrectl_c.so", "lugrectl_d.py", "lugrectl_d.so"]


def run(folder):
    there = dict(os.environ) | {"LUGRECTL_CACHE": str(folder)}
    return subprocess.Popen([sys.executable, "-c", USE], env=there, stdout=subprocess.PIPE)


@pytest.mark.slow
def test_code_of_numba_that_was_cut_off_is_compiled_again(folder):
    pytest.importorskip("numba")
    wanted = run(folder).communicate()[0]
    kept = list(folder.glob("__pycache__/*.nb?"))
    assert kept and wanted
    for file in kept:
        file.write_bytes(file.read_bytes()[:3000])
    assert run(folder).communicate()[0] == wanted


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="there is no SIGKILL here")
def test_a_killed_compilation_leaves_nothing_that_is_wrong(folder):
    start = time.monotonic()
    wanted = run(folder.with_name("other")).communicate()[0]
    whole = time.monotonic() - start
    for part in np.linspace(0.3, 0.98, 10):
        process = run(folder)
        time.sleep(part * whole)
        process.send_signal(signal.SIGKILL)
        process.communicate()
    assert run(folder).communicate()[0] == wanted
