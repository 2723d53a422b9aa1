"""Generated source made a module: compiled, kept in a cache directory, and checked before use."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import hashlib
import importlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import numpy as np

from ...core.blas_threads import processors
from ...core.errors import InputError
from ...core.writing import whole as written_whole
from ..codegen.c_source import NUMBER, WHOLE, Kind, c_code, lengths
from ..codegen.python_source import ARRAY_HEADER, SCALAR_HEADER
from ..expression.numpy_protocol import LIBRARY, WIDTH


def cache_dir() -> Path:
    """The directory of generated code: $LUGRECTL_CACHE, else the user's cache directory; where
    others can write to it one beside it, where none can be written a temporary one."""
    if os.name == "nt":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return _usable(os.environ.get("LUGRECTL_CACHE") or str(Path(base) / "lugrectl"))


@cache
def temporary() -> Path:
    """A directory that ends with this process, for when the cache's disk is full."""
    made = tempfile.TemporaryDirectory(prefix="lugrectl-", ignore_cleanup_errors=True)
    atexit.register(made.cleanup)
    return Path(made.name)


@cache
def _usable(wanted: str) -> Path:
    for path in (Path(wanted), Path(f"{wanted}-own")):
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.mkdir(mode=0o700, exist_ok=True)
            found = path.stat()
            # only this user (and the administrator) may put code into it
            if os.name != "posix" or (found.st_uid == os.getuid() and not found.st_mode & 0o022):
                with tempfile.TemporaryFile(dir=path):
                    return path
    return temporary()


def whole(path: Path) -> contextlib.AbstractContextManager[Path]:
    """A temporary file that is renamed at the end: other processes see all of it or nothing."""
    return written_whole(path, 0o600)


def in_cache(make: Callable[[Path], Path]) -> Path:
    """A file made in the cache, in a temporary directory where the disk is full."""
    try:
        return make(cache_dir())
    except OSError:
        return make(temporary())


def keep(path: Path, text: str) -> Path:
    """Write generated code to a file of the cache, where it is not there already."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        if path.read_text(encoding="utf-8") == text:
            return path
    with whole(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def _seal(path: Path) -> tuple[Path, str]:
    """The file beside a compiled one that says what it is, and what that is now."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return path.with_suffix(path.suffix + ".sha256"), digest


def is_sound(path: Path) -> bool:
    """Whether a compiled file is what it was when it was made."""
    try:
        place, digest = _seal(path)
        return place.read_text() == digest
    except (OSError, UnicodeDecodeError):
        return False


PLAIN = ("-O2", "-fPIC", "-shared", "-fno-math-errno", "-fno-trapping-math")
PLAIN += ("-Werror=implicit-function-declaration",)
# FUSED and WIDE may round a product and a sum once: values then depend on the machine
FUSED = (*PLAIN, "-mfma", "-fno-tree-slp-vectorize")  # pairs of numbers cost more than they save
# for several numbers at once; sine and cosine of one angle would become one call, which the
# library has for one number only
WIDE = ("-O3", *PLAIN[1:], "-mavx2", "-mfma", "-fno-builtin-cos", "-Wl,-z,defs")
_ABLE = """
#if defined(__clang__) || !defined(__GNUC__)
#error another compiler does not know the library
#endif
static double able(void) {
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}
"""
_KNOWN = '__attribute__((simd("notinbranch"), const, nothrow, leaf)) double {}(double{});'
SUFFIX = ".dll" if sys.platform == "win32" else ".so"
_LEAST = "def run(a):\n    a[0] = sqrt(a[0])\n"
_SEVERAL = "def run(a):\n    for i in range({}):\n        a[i] = exp(a[i])\n"


class Native:
    """The last function of a source text, compiled at its first call for the kinds of arguments:
    floats, whole numbers, arrays in C order. ``flags`` other than PLAIN need :func:`has_wide`."""

    def __init__(self, source: str, flags: tuple[str, ...] = PLAIN) -> None:
        self.source, self.flags = source, flags
        self._lock, self._made = threading.Lock(), dict[tuple[Any, ...], Any]()

    def __call__(self, *arguments: Any) -> int:
        forms = tuple(
            [(a.dtype, a.ndim) if isinstance(a, np.ndarray) else type(a) for a in arguments]
        )
        passed = [part for i, a in enumerate(arguments) for part in _passed(i, a)]
        run = self._made.get(forms)
        if run is None:
            kinds = tuple(_kind(i, a) for i, a in enumerate(arguments))
            pairs = [(name, ", double" * (name == "pow")) for name in LIBRARY]
            known = "\n".join(_KNOWN.format(*pair) for pair in pairs) if self.flags == WIDE else ""
            with self._lock:
                run = _loaded(c_code(self.source, kinds, known), kinds, self.flags)
                self._made[forms] = run
        return run(*passed)


@cache
def has_compiler() -> bool:
    """Whether there is a C compiler ($CC, else cc) and its output can be loaded."""
    there = np.array([4.0])
    try:
        Native(_LEAST)(there)
    except (InputError, OSError):
        return False
    return bool(there[0] == 2.0)


@cache
def has_wide() -> bool:
    """Whether compiler, processor and library can compute several numbers at once."""
    there, several = np.zeros(1), np.linspace(-700.0, 1.0, WIDTH)
    want = np.exp(several)
    try:
        able = c_code("def run(a):\n    a[0] = able()\n", (_kind(0, there),), _ABLE)
        _loaded(able, (_kind(0, there),), PLAIN)(*_passed(0, there))
        if there[0] == 1.0:
            Native(_SEVERAL.format(WIDTH), WIDE)(several)
    except (InputError, OSError):
        return False
    return bool(there[0] == 1.0 and np.allclose(several, want, rtol=1e-14, atol=0.0))


def _kind(place: int, value: Any) -> Kind:
    if not isinstance(value, np.ndarray):
        return NUMBER if isinstance(value, float) else WHOLE
    if value.dtype.str[1:] not in ("f8", "i8"):
        raise TypeError(f"argument {place}: {value.dtype}")
    return Kind("i" if value.dtype.kind == "i" else "d", lengths(place, value.ndim))


def _passed(place: int, value: Any) -> list[Any]:
    if not isinstance(value, np.ndarray):
        return [value]
    if not value.flags.c_contiguous:
        raise TypeError(f"argument {place}: in another order")
    if value.size and value.flags.writeable:  # a tenth of the time of value.ctypes
        return [ctypes.addressof(ctypes.c_char.from_buffer(value.data)), *value.shape]
    return [value.ctypes.data, *value.shape]


def _loaded(text: str, kinds: tuple[Kind, ...], flags: tuple[str, ...]) -> Any:
    compiler = _compiler()
    key = repr((text, compiler, flags, platform.machine(), platform.libc_ver()))
    name = f"lugrectl_{hashlib.sha256(key.encode()).hexdigest()[:20]}.c"
    made = in_cache(lambda folder: _made(folder / name, text, compiler, flags))
    run = ctypes.CDLL(str(made)).run
    run.restype, run.argtypes = ctypes.c_int64, []
    for kind in kinds:
        number = ctypes.c_double if kind == NUMBER else ctypes.c_int64
        run.argtypes += [ctypes.c_void_p if kind.shape else number]
        run.argtypes += [ctypes.c_int64] * len(kind.shape)
    return run


def _made(path: Path, text: str, compiler: tuple[str, ...], flags: tuple[str, ...]) -> Path:
    """The library of a source, built where it is not there or not what it was."""
    made = path.with_suffix(SUFFIX)
    if not is_sound(made):
        keep(path, text)
        _build([*compiler, *flags], path, made)
        place, digest = _seal(made)
        with whole(place) as part:
            part.write_text(digest)
    return made


@cache
def _compiler() -> tuple[str, ...]:
    words = shlex.split(os.environ.get("CC", "cc"))
    found = shutil.which(words[0]) if words else None
    if found == "/usr/bin/cc" and sys.platform == "darwin":
        # without developer tools the cc of a Mac opens a window that offers to install them
        if subprocess.run(["xcode-select", "-p"], capture_output=True).returncode:
            found = None
    if found is None:
        raise InputError("there is no C compiler; set the environment variable CC to name one.")
    return (found, *words[1:])


def _build(command: Sequence[str], path: Path, made: Path) -> None:
    with whole(made) as part:
        command = [*command, "-o", str(part), str(path), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        if done.returncode:
            lines = [k for k in done.stderr.splitlines() if "error" in k] or [done.stderr]
            raise InputError(
                f"{command[0]} cannot compile: {lines[0]} Set CC to nothing to do without it."
            )


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
    """The compiler of loops: "c", as fast as "numba" and ten times faster to compile, if there."""
    return "c" if has_compiler() else "numba" if has_numba() else None


def kind_of(backend: str) -> str:
    """The kind of text that a backend reads: "python", whose errors are caught, or "compiled"."""
    return "python" if backend == "python" else "compiled"


def load(source: str, backend: str) -> ModuleType:
    """The module of a source text; ``fast`` marks the functions that numba compiles, ``small``
    those that only these call. ``backend`` is "numba", "python" (not compiled), "numpy", or, for
    the last function in C, "c", "fused" (a product and a sum are rounded once) or "wide"."""
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


def laid_out(given: Iterable[Any], backend: str) -> list[Any]:
    """Arguments of generated code: arrays in one layout, or lists, which plain Python prefers."""

    def one(value: Any) -> Any:
        if not isinstance(value, np.ndarray):
            return value
        if backend == "python":
            return value.tolist()
        return np.require(value, float if value.dtype.kind == "f" else np.int64, ["C", "W"])

    return [one(value) for value in given]


def call(run: Any, backend: str, given: Sequence[Any], filled: Sequence[np.ndarray]) -> int:
    """Call generated code that fills arrays behind its arguments."""
    if backend != "python":
        return run(*given, *filled)
    lists = laid_out(filled, backend)
    code = run(*given, *lists)
    for target, rows in zip(filled, lists, strict=True):
        target[...] = np.array(rows).reshape(target.shape)
    return code


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
    path = in_cache(lambda folder: keep(folder / f"{name}.py", text))
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def threads() -> int:
    """The number of threads for compiled code: $NUMBA_NUM_THREADS, else the processors."""
    if getattr(_THREAD, "alone", False):
        return 1
    asked = os.environ.get("NUMBA_NUM_THREADS", "")
    if asked.isdigit():
        return max(1, int(asked))
    return processors()


def alone() -> None:
    """Mark the calling thread: it must not start other threads."""
    _THREAD.alone = True


def each_beside(work: Callable[[Item], Made], items: Iterable[Item]) -> Iterator[Made]:
    """``work`` on each item, in order, on threads if code is compiled: that lets others run."""
    given = list(items)
    workers = min(threads() if compiler() else 1, len(given))
    if workers < 2:
        yield from map(work, given)
        return
    with ThreadPoolExecutor(workers, initializer=alone) as pool:
        yield from pool.map(work, given)
