"""Generated loops compiled by the C compiler of the machine, if there is one."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import threading
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ..codegen.c_source import NUMBER, WHOLE, Kind, c_code, lengths
from ..expression.operations import LIBRARY, WIDTH
from .disk_cache import cache_dir, is_sound, keep, seal, temporary, whole

_FLAGS = ("-O2", "-fPIC", "-shared", "-fno-math-errno", "-fno-trapping-math")
_FLAGS += ("-Werror=implicit-function-declaration",)
# for several numbers at once; sine and cosine of one angle would become one call, which the
# library has for one number only
_WIDE = ("-O3", *_FLAGS[1:], "-mavx2", "-mfma", "-fno-builtin-cos", "-Wl,-z,defs")
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
    """The last function of a source text, compiled at its first call for the arguments' kinds.

    Parameters
    ----------
    source : str
        A function of floats, whole numbers and arrays in C order, as :func:`c_code` reads it,
        after those that it calls.
    wide : bool
        Whether to vectorise its innermost loops; needs :func:`has_wide`.
    fused : bool
        Whether a wide loop may round a product and a sum once: values then depend on the machine.
    """

    def __init__(self, source: str, *, wide: bool = False, fused: bool = True) -> None:
        self.source, self.flags = source, _FLAGS
        if wide:
            self.flags = _WIDE if fused else (*_WIDE, "-ffp-contract=off")
        self._lock, self._made = threading.Lock(), dict[tuple[Kind, ...], Any]()

    def __call__(self, *arguments: Any) -> int:
        kinds = tuple(_kind(i, a) for i, a in enumerate(arguments))
        with self._lock:
            if kinds not in self._made:
                self._made[kinds] = _compiled(self.source, kinds, self.flags)
        return self._made[kinds](*(part for a in arguments for part in _passed(a)))


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
        _loaded(able, _FLAGS)(*_passed(there))
        if there[0] == 1.0:
            Native(_SEVERAL.format(WIDTH), wide=True)(several)
    except (InputError, OSError):
        return False
    return bool(there[0] == 1.0 and np.allclose(several, want, rtol=1e-14, atol=0.0))


def _kind(place: int, value: Any) -> Kind:
    if not isinstance(value, np.ndarray):
        return NUMBER if isinstance(value, float) else WHOLE
    if not value.flags.c_contiguous or value.dtype.str[1:] not in ("f8", "i8"):
        raise TypeError(f"argument {place}: {value.dtype}, or in another order")
    return Kind("i" if value.dtype.kind == "i" else "d", lengths(place, value.ndim))


def _passed(value: Any) -> list[Any]:
    if isinstance(value, np.ndarray):
        return [ctypes.c_void_p(value.ctypes.data), *map(ctypes.c_int64, value.shape)]
    return [ctypes.c_double(value) if isinstance(value, float) else ctypes.c_int64(value)]


def _compiled(source: str, kinds: tuple[Kind, ...], flags: tuple[str, ...]) -> Any:
    if flags is _FLAGS:
        return _loaded(c_code(source, kinds), flags)
    declared = [_KNOWN.format(name, ", double" * (name == "pow")) for name in LIBRARY]
    return _loaded(c_code(source, kinds, "\n".join(declared)), flags)


def _loaded(text: str, flags: tuple[str, ...]) -> Any:
    compiler = _compiler()
    key = repr((text, compiler, flags, platform.machine(), platform.libc_ver()))
    name = f"lugrectl_{hashlib.sha256(key.encode()).hexdigest()[:20]}.c"
    try:
        made = _made(cache_dir() / name, text, compiler, flags)
    except OSError:  # the disk is full
        made = _made(temporary() / name, text, compiler, flags)
    run = ctypes.CDLL(str(made)).run
    run.restype = ctypes.c_int64
    return run


def _made(path: Path, text: str, compiler: tuple[str, ...], flags: tuple[str, ...]) -> Path:
    """The library of a source, built where it is not there or not what it was."""
    made = path.with_suffix(SUFFIX)
    if not is_sound(made):
        keep(path, text)
        _build(compiler, path, made, flags)
        seal(made)
    return made


@cache
def _compiler() -> tuple[str, ...]:
    words = shlex.split(os.environ.get("CC", "cc"))
    found = shutil.which(words[0]) if words else None
    if found is None or _opens_a_window(found):
        raise InputError("there is no C compiler; set the environment variable CC to name one.")
    return (found, *words[1:])


def _opens_a_window(found: str) -> bool:
    """Whether it is the cc of a Mac without developer tools, which only offers to install them."""
    if sys.platform != "darwin" or found != "/usr/bin/cc":
        return False
    return subprocess.run(["xcode-select", "-p"], capture_output=True).returncode != 0


def _build(compiler: tuple[str, ...], path: Path, made: Path, flags: tuple[str, ...]) -> None:
    with whole(made) as part:
        command = [*compiler, *flags, "-o", str(part), str(path), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        if done.returncode:
            lines = [k for k in done.stderr.splitlines() if "error" in k] or [done.stderr]
            raise InputError(
                f"{compiler[0]} cannot compile: {lines[0]} Set CC to nothing to do without it."
            )
