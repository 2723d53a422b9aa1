"""Generated loops in C against the same text run as Python, and what is kept and said."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from lugrectl.core.errors import InputError
from lugrectl.engine import backend
from lugrectl.engine.backend import (
    NUMBER,
    SUFFIX,
    Native,
    c_code,
    has_compiler,
)
from lugrectl.engine.python_source import summed

needs_c = pytest.mark.skipif(not has_compiler(), reason="there is no C compiler")

# one of everything that the emitters write
TEXT = """
import numpy as np

FAR = 40


def farther(a, far):
    half = 0.5 * a
    return half if abs(half) > far else far


def run(table, places, scale, often, wanted, out, first, last):
    n, least = 5, scale / often
    own = np.zeros(6)
    sums = np.zeros(6)
    total = 0
    for i in range(first, last):
        row = table[i]
        sums[i] = 0.0
        for c in range(n):
            value = row[c]
            if value != value:
                continue
            sums[i] += max(value, -1.5) + min(abs(value), 2.0) * (1.0 if c < 2 else 0.5)
        left, sign = scale, 1.0 if sums[i] > 0.0 else (-1.0 if sums[i] < 0.0 else 0.0)
        while left > least and not (left > 1e3 or left != left):
            left = left * 0.5
        own[4 + 1] = left
        total = total + sign * i / often
        if wanted:
            out[places[i]][0] = sums[i] + sqrt(left) + exp(-left) + own[5] + own[0]
        else:
            out[places[i]][0] = -sums[i]
        out[places[i]][1] = total
        out[places[i]][1] -= inf if (left < 0.0 and wanted) else 0.0
    before, now = 1.0, 1.0
    while True:
        often += 1
        before, now = now, before + now
        if now > FAR:
            break
    out[0][0] = before + farther(-now, 3) + often % 4 + max(table[0][1], least, -2.0)
    return often
"""


def given(wanted: bool) -> list:
    random = np.random.default_rng(4)
    table = random.standard_normal((6, 5))
    table[2, 3] = np.nan
    return [table, np.array([5, 3, 1, 0, 2, 4]), 8.0, 7, wanted, np.zeros((6, 2)), 1, 6]


@needs_c
@pytest.mark.parametrize("wanted", [True, False])
def test_c_and_python_read_one_text_the_same_way(wanted: bool) -> None:
    names = {"sqrt": math.sqrt, "exp": math.exp, "inf": math.inf}
    exec(TEXT, names)
    plain, compiled = given(wanted), given(wanted)
    often = names["run"](*plain)  # type: ignore[operator]
    assert Native(TEXT)(*compiled) == often > 7
    np.testing.assert_allclose(compiled[5], plain[5], rtol=1e-14)
    assert np.all(plain[5][[5]] == 0.0) and np.all(plain[5][[0, 1, 2, 3, 4], 0] != 0.0)


@needs_c
def test_what_the_compiler_refuses_is_one_sentence_and_leaves_nothing(
    tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LUGRECTL_CACHE", str(tmp_path))
    with pytest.raises(InputError, match="cannot compile.*unknown"):
        Native("def run(a):\n    a[0] = unknown(a[0])\n")(np.zeros(1))
    assert not [p for p in tmp_path.iterdir() if p.suffix != ".c"]


@pytest.mark.parametrize("words", ["", "no-such-compiler-anywhere"])
def test_no_compiler_is_no_error(words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", words)
    backend._compiler.cache_clear()
    try:
        assert not has_compiler.__wrapped__()
    finally:
        backend._compiler.cache_clear()


def test_what_c_has_no_word_for_is_named() -> None:
    with pytest.raises(ValueError, match="cannot be translated to C: with"):
        c_code("def run(a):\n    with a:\n        pass\n", [NUMBER])


def test_a_long_sum_is_not_deep() -> None:
    """The state of a long dead time has thousands of numbers: Python and C nest no sum of them."""
    text = summed([f"{i}.0" for i in range(20000)])
    assert eval(text) == sum(range(20000))  # noqa: S307
    assert "+ 19999.0" in c_code(f"def run(a):\n    return a + {text}\n", [NUMBER])


# What is loaded from the cache is checked: damaged code is built again, planted code never run.


ROOT = "def run(a):\n    a[0] = sqrt(a[0]) + {}\n"


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
