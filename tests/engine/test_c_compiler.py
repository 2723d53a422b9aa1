"""Generated loops in C against the same text run as Python, and what is kept and said."""

from __future__ import annotations

import gc
import math
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lugrectl.core.errors import InputError
from lugrectl.engine.codegen.c_source import NUMBER, Kind, c_code
from lugrectl.engine.codegen.python_source import summed
from lugrectl.engine.runtime import backend
from lugrectl.engine.runtime.backend import Native, has_compiler

needs_compiler = pytest.mark.skipif(not has_compiler(), reason="there is no C compiler")

# one of everything that the emitters write
TEXT = """
import numpy as np

FAR = 40


def farther(a, far):
    half = 0.5 * a
    return half if abs(half) > far else far


def longest(rows):
    most = -inf
    for i in range(len(rows)):
        most = max(most, rows[i][1], -2.0)
        if most > 1.5:
            break
    if most < 0.0:
        return False
    return 2


def run(table, places, scale, often, wanted, out, first, last):
    n, least = table.shape[1], scale / often
    own, sums = np.zeros((2, 3)), np.empty(len(places))
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
        own[1, 1 + 1] = left
        total = total + sign * i / often
        if wanted:
            out[places[i], 0] = sums[i] + sqrt(left) + exp(-left) + own[1, 2] + own[0, 1]
        else:
            out[places[i], 0] = -sums[i]
        out[places[i], 1] = total
        out[places[i], 1] -= inf if (left < 0.0 and wanted) else 0.0
    before = now = 1.0
    while True:
        often += 1
        before, now = now, before + now
        if now > FAR:
            break
    out[0, 0] = before + farther(-now, 3) + often % 4 + longest(table)
    return often
"""


def given(wanted: bool) -> list:
    random = np.random.default_rng(4)
    table = random.standard_normal((6, 5))
    table[2, 3] = np.nan
    return [table, np.array([5, 3, 1, 0, 2, 4]), 8.0, 7, wanted, np.zeros((6, 2)), 1, 6]


@needs_compiler
@pytest.mark.parametrize("wanted", [True, False])
def test_c_and_python_read_one_text_the_same_way(wanted: bool) -> None:
    names = {"sqrt": math.sqrt, "exp": math.exp, "inf": math.inf}
    exec(TEXT, names)
    plain, compiled = given(wanted), given(wanted)
    often = names["run"](*plain)  # type: ignore[operator]
    assert Native(TEXT)(*compiled) == often > 7
    np.testing.assert_allclose(compiled[5], plain[5], rtol=1e-14)
    assert np.all(plain[5][[5]] == 0.0) and np.all(plain[5][[0, 1, 2, 3, 4], 0] != 0.0)


@needs_compiler
def test_a_library_is_made_once(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LUGRECTL_CACHE", str(tmp_path))
    source = "def run(a):\n    a[0] = a[0] + 1.5\n"
    made = np.zeros(1)
    Native(source)(made)
    monkeypatch.setattr(backend, "_build", lambda *_: pytest.fail("compiled again"))
    Native(source)(made)
    assert made[0] == 3.0
    assert sorted(p.suffix for p in tmp_path.iterdir()) == sorted([".c", backend.SUFFIX, ".sha256"])


@needs_compiler
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


def test_arrays_in_another_order_are_refused() -> None:
    with pytest.raises(TypeError, match="argument 0"):
        Native("def run(a):\n    pass\n")(np.zeros((3, 2)).T)


def test_threads_write_c_at_the_same_time(often_interrupted) -> None:
    source = "def run(a):\n" + "    a[0] = a[0] * 2.0 + (1.0 - a[0])\n" * 50
    kind = [Kind("d", ("n",))]
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda _: c_code(source, kind), range(8)))
    assert len(set(made)) == 1


@pytest.fixture
def often_interrupted():
    """Garbage collection that hands over to other threads, as a long run has it now and then."""
    before = gc.get_threshold()

    def pause(phase: str, info: object) -> None:
        time.sleep(1e-4)

    gc.callbacks.append(pause)
    gc.set_threshold(50)
    yield
    gc.set_threshold(*before)
    gc.callbacks.remove(pause)
