"""Loads generated source as a module: a file in the cache directory, so that numba can keep its
machine code there for the next process."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from types import ModuleType
from typing import Any, TypeVar

from ...core.errors import InputError
from ..codegen.python_source import ARRAY_HEADER, SCALAR_HEADER
from .c_compiler import FUSED, PLAIN, WIDE, Native, has_compiler, has_wide
from .disk_cache import cache_dir, keep, temporary

# a b + c may be rounded once; the other options of fastmath would change the meaning of the code
NUMBA_HEADER = """from numba import njit
from numpy import floor as floored

fast = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
small = njit(error_model="numpy", fastmath={"contract"})
"""
_FAST = "\n\ndef fast(function):\n    return function\n"
HEADERS: Mapping[str, str] = {
    "numba": SCALAR_HEADER + NUMBA_HEADER,
    "python": SCALAR_HEADER + "import numpy as np\n" + _FAST + "\n\nsmall = fast\n",
    "numpy": ARRAY_HEADER + _FAST,
}
FLAGS = {"c": PLAIN, "fused": FUSED, "wide": WIDE}

Item = TypeVar("Item")
Made = TypeVar("Made")
_LOADING, _THREAD = threading.RLock(), threading.local()

DEEP = 20_000  # numba follows the branches of a function by recursion, two calls for each


@cache
def has_numba() -> bool:
    """Whether numba is installed and works with this NumPy."""
    with contextlib.suppress(ImportError):
        return bool(importlib.import_module("numba"))
    return False


def compiler() -> str | None:
    """The compiler of loops over lanes: "c" (as fast as "numba", compiled in a tenth of the
    time), else "numba", else None."""
    return "c" if has_compiler() else "numba" if has_numba() else None


def kind_of(backend: str) -> str:
    """The kind of text that a backend reads: "python", whose errors are caught, or "compiled"."""
    return "python" if backend == "python" else "compiled"


def load(source: str, backend: str) -> ModuleType:
    """The module of a source text; ``fast`` marks the functions that numba compiles, ``small``
    those that only these call.

    ``backend`` is "numba", "python" (the same text, not compiled), "numpy", or, for its last
    function, "c", "fused", which may round a product and a sum once, or "wide": C that computes
    several turns of its innermost loops at once.
    """
    text = HEADERS.get(backend, "") + "\n\n" + source
    name = f"lugrectl_{backend}_{hashlib.sha256(text.encode()).hexdigest()[:20]}"
    with _LOADING:  # another thread must not see a partly loaded module
        if name not in sys.modules:
            try:
                if backend == "numba":
                    sys.modules[name] = _from_file(text, name)
                elif backend in FLAGS:
                    sys.modules[name] = module = ModuleType(name)
                    last = text.rpartition("\ndef ")[2].partition("(")[0]
                    module.__dict__[last] = _OrPlain(Native(text, FLAGS[backend]), text, last)
                else:
                    sys.modules[name] = _direct(text, name)
            except OSError as error:
                sys.modules[name] = _plain(source, name, error)
        return sys.modules[name]


def load_steps(source: str, backend: str) -> ModuleType:
    """As :func:`load`, for a run that controls its own error: rounding may be the machine's."""
    return load(source, "fused" if backend == "c" and has_wide() else backend)


def _direct(text: str, name: str) -> ModuleType:
    module = ModuleType(name)
    exec(compile(text, f"<{name}>", "exec"), module.__dict__)
    return module


class _OrPlain:
    """Compiled code at its first call; the same text in Python where no file can be written."""

    def __init__(self, run: Any, text: str, name: str) -> None:
        self.run, self.text, self.name, self.tried = run, text, name, False

    def __call__(self, *arguments: Any) -> Any:
        if self.tried:
            return self.run(*arguments)
        try:
            result = self.run(*arguments)
        except (OSError, InputError) as error:
            self.run = getattr(_plain(self.text, self.name, error), self.name)
            result = self.run(*arguments)
        self.tried = True
        return result


def _plain(source: str, name: str, why: Exception) -> ModuleType:
    _say_once(getattr(why, "strerror", None) or str(why))
    return _direct(HEADERS["python"] + "\n\n" + source, name)


@cache
def _say_once(why: str) -> None:
    warnings.warn(
        f"simulations run as plain Python, which is slow: their code cannot be compiled ({why}).",
        RuntimeWarning,
        stacklevel=2,
    )


def _from_file(text: str, name: str) -> ModuleType:
    sys.setrecursionlimit(max(sys.getrecursionlimit(), DEEP))
    try:
        path = cache_dir() / f"{name}.py"
        keep(path, text)
    except OSError:  # the disk is full
        path = temporary() / f"{name}.py"
        keep(path, text)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    for function in vars(module).values():
        kept = getattr(function, "_cache", None)
        if hasattr(kept, "load_overload"):
            _distrust(kept)
    return module


def _distrust(kept: Any) -> None:
    """Let numba compile again where its own files cannot be read."""
    read = kept.load_overload

    def load_overload(*given: Any) -> Any:
        try:
            return read(*given)
        except Exception:  # whatever a damaged pickle raises
            kept.flush()
            return None

    kept.load_overload = load_overload


def threads() -> int:
    """The number of threads for compiled code: the processors, or $NUMBA_NUM_THREADS; 1 in a
    thread marked by :func:`alone`."""
    if getattr(_THREAD, "alone", False):
        return 1
    asked = os.environ.get("NUMBA_NUM_THREADS", "")
    if asked.isdigit():
        return max(1, int(asked))
    given = getattr(os, "sched_getaffinity", None)  # not on every system
    return len(given(0)) if given else os.cpu_count() or 1


def alone() -> None:
    """Mark the calling thread: it must not start other threads."""
    _THREAD.alone = True


def each_beside(work: Callable[[Item], Made], items: Iterable[Item]) -> Iterator[Made]:
    """The results of ``work`` on each item, in the items' order, each as soon as it is there.

    Each call uses one thread. Without compiled code, which lets other threads run, the items are
    processed one after another.
    """
    given = list(items)
    workers = min(threads() if compiler() else 1, len(given))
    if workers < 2:
        yield from map(work, given)
        return
    with ThreadPoolExecutor(workers, initializer=alone) as pool:
        yield from pool.map(work, given)
