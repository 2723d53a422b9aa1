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
    """The last function of a source text, compiled at its first call for the arguments' kinds.

    It may take floats, whole numbers and arrays in C order, as :func:`c_code` reads them.
    ``flags`` are PLAIN, or, with :func:`has_wide`, FUSED, or WIDE to vectorise its innermost loops.
    """

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
    try:
        made = _made(cache_dir() / name, text, compiler, flags)
    except OSError:  # the disk is full
        made = _made(temporary() / name, text, compiler, flags)
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
        _build(compiler, path, made, flags)
        seal(made)
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


def _build(compiler: tuple[str, ...], path: Path, made: Path, flags: tuple[str, ...]) -> None:
    with whole(made) as part:
        command = [*compiler, *flags, "-o", str(part), str(path), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        if done.returncode:
            lines = [k for k in done.stderr.splitlines() if "error" in k] or [done.stderr]
            raise InputError(
                f"{compiler[0]} cannot compile: {lines[0]} Set CC to nothing to do without it."
            )
