"""Generated source as a module: a real file in a cache directory, so that numba can keep
its machine code beside it for the next process."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import os
import sys
import tempfile
import threading
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import ModuleType

from .emit import ARRAY_HEADER, SCALAR_HEADER

# a b + c may be rounded once: what else fastmath allows would change the meaning of code
NUMBA_HEADER = """from numba import njit

fast = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
small = njit(error_model="numpy", fastmath={"contract"})
"""
HEADERS: Mapping[str, str] = {
    "numba": SCALAR_HEADER + NUMBA_HEADER,
    "python": SCALAR_HEADER
    + "import numpy as np\n\n\ndef fast(function):\n    return function\n\n\nsmall = fast\n",
    "numpy": ARRAY_HEADER + "\n\ndef fast(function):\n    return function\n",
}

_LOADING, _THREAD = threading.RLock(), threading.local()

DEEP = 20_000  # numba follows the branches of a function by recursion, two calls for each


@cache
def has_numba() -> bool:
    """Whether numba is there and goes with this NumPy."""
    try:
        importlib.import_module("numba")
    except ImportError:
        return False
    return True


def cache_dir() -> Path:
    """Where generated code is kept: $LUGRECTL_CACHE, else the user's cache directory.

    A temporary directory of this process where neither can be written.
    """
    return _usable(os.environ.get("LUGRECTL_CACHE") or str(_user_cache()))


def _user_cache() -> Path:
    if os.name == "nt":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "lugrectl"


@cache
def _usable(wanted: str) -> Path:
    try:
        path = Path(wanted)
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return path
    except OSError:
        return Path(tempfile.mkdtemp(prefix="lugrectl-"))


def load(source: str, backend: str) -> ModuleType:
    """The module of a source text; ``fast`` decorates what numba shall compile.

    Parameters
    ----------
    source : str
        Function definitions, decorated by ``fast``; by ``small`` where only they call them.
    backend : str
        "numba", "python" (the same text, not compiled) or "numpy".
    """
    text = HEADERS[backend] + "\n\n" + source
    name = f"lugrectl_{backend}_{hashlib.sha256(text.encode()).hexdigest()[:20]}"
    with _LOADING:  # another thread shall not see a module that is half there
        if name not in sys.modules:
            make = _from_file if backend == "numba" else _direct
            sys.modules[name] = make(text, name)
        return sys.modules[name]


def _direct(text: str, name: str) -> ModuleType:
    module = ModuleType(name)
    exec(compile(text, f"<{name}>", "exec"), module.__dict__)
    return module


def _from_file(text: str, name: str) -> ModuleType:
    sys.setrecursionlimit(max(sys.getrecursionlimit(), DEEP))
    path = cache_dir() / f"{name}.py"
    if not path.exists():
        _write_whole(path, text)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _write_whole(path: Path, text: str) -> None:
    """Another process sees the whole file or none."""
    _make_room(path.parent)
    handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(part, path)


def _make_room(folder: Path, most: int = 500) -> None:
    """Drop the older half of a full cache, compiled code included."""
    sources = list(folder.glob("lugrectl_*.py"))
    if len(sources) < most:
        return
    with contextlib.suppress(OSError):
        for old in sorted(sources, key=lambda path: path.stat().st_mtime)[: most // 2]:
            for compiled in (folder / "__pycache__").glob(f"{old.stem}.*"):
                compiled.unlink()
            old.unlink()


def threads() -> int:
    """How many threads numba code may use: the processors, or $NUMBA_NUM_THREADS; one where
    the others are at work already."""
    from numba import config

    return 1 if getattr(_THREAD, "alone", False) else int(getattr(config, "NUMBA_NUM_THREADS", 1))


def alone() -> None:
    """Called in a thread that shall not start others."""
    _THREAD.alone = True
