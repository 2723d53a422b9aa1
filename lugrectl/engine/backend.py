"""Generated source made a module: translated to C, compiled, kept in a cache directory, checked.

The loops are translated statement by statement, from a subset of Python.
"""

from __future__ import annotations

import ast
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
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn, TypeVar

import numpy as np

from ..core.blas_threads import processors
from ..core.errors import InputError
from ..core.writing import whole
from .graph import LIBRARY, WIDTH
from .python_source import SCALAR_HEADER


def cache_dir() -> Path:
    """The directory of generated code: $LUGRECTL_CACHE, else the user's cache directory; where
    others can write to it one beside it, where none can be written a temporary one."""
    usual = "LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME"
    base = os.environ.get(usual) or Path.home() / ".cache"
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
    with whole(path, 0o600) as part:
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


_HEADER = """#include <math.h>
#include <stdint.h>
#include <string.h>
static inline double most(double a, double b) { return b > a ? b : a; }
static inline double least(double a, double b) { return b < a ? b : a; }
"""
_TYPES = {"d": "double", "i": "int64_t"}
_SIGNS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.USub: "-"}
_SIGNS |= {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_SIGNS |= {ast.And: "&&", ast.Or: "||", ast.Not: "!", ast.Mod: "%"}  # remainder of counts >= 0
_CALLS = {"abs": "fabs", "floored": "floor", "max": "most", "min": "least"}
_CONSTANTS = {"inf": "INFINITY", "nan": "NAN"}

_PARSING = threading.Lock()  # Python 3.11 counts the depth of syntax trees globally


@dataclass(frozen=True)
class Kind:
    """The type of a C expression: "d" or "i", and the lengths of its axes if it is an array."""

    of: str
    shape: tuple[str, ...] = ()


NUMBER, WHOLE = Kind("d"), Kind("i")
Value = tuple[str, Kind]


def c_code(source: str, kinds: Sequence[Kind], before: str = "") -> str:
    """The last function of a source text as ``int64_t run`` in C, with those that it calls, for the
    kinds of its arguments. An array is passed as its address and the lengths of its axes."""
    with _PARSING:
        tree = ast.parse(source)
    functions = [n for n in tree.body if isinstance(n, ast.FunctionDef)]
    set_once = [n for n in tree.body if isinstance(n, ast.Assign)]
    numbers = {t.id: n.value for n in set_once for t in n.targets if isinstance(t, ast.Name)}
    unit = _Unit({f.name: f for f in functions}, numbers)
    unit.add(functions[-1].name, kinds, "int64_t run")
    return "\n".join([_HEADER, before, *unit.texts, ""])


@dataclass
class _Unit:
    """The functions and numbers of a source text, and the functions that are translated."""

    functions: Mapping[str, ast.FunctionDef]
    numbers: Mapping[str, ast.expr]
    texts: list[str] = field(default_factory=list)
    returns: dict[str, Kind] = field(default_factory=dict)

    def add(self, name: str, kinds: Sequence[Kind], head: str = "") -> Kind:
        """Translate a function for the kinds of its arguments; the kind of what it returns."""
        function = self.functions[name]
        given = {a.arg: kind for a, kind in zip(function.args.args, kinds, strict=True)}
        writer = _Writer(given, self)
        body = writer.block(function.body, 1)
        while writer.promoted:  # an integer variable later holds a double: again with it
            writer = _Writer({**given, **writer.kinds}, self)
            body = writer.block(function.body, 1)
        own = [
            f"    {_TYPES[v.of]} {'*' if v.shape else ''}{k}_;"
            for k, v in writer.kinds.items()
            if k not in given
        ]
        taken = ", ".join(
            part
            for k, v in given.items()
            for part in (
                f"{_TYPES[v.of]} {'*restrict ' if v.shape else ''}{k}_",
                *(f"int64_t {length}" for length in v.shape),
            )
        )
        head = head or f"static inline {_TYPES[writer.returned.of]} {name}_"
        self.texts += [f"{head}({taken})", "{", *own, *body, "    return 0;", "}"]
        self.returns[name] = writer.returned
        return writer.returned


def lengths(place: int, axes: int) -> tuple[str, ...]:
    """The names of the lengths of an argument's axes."""
    return tuple(f"n{place}_{i}" for i in range(axes))


class _Writer:
    """Writes statements and expressions; keeps the kinds of the names seen so far."""

    def __init__(self, given: Mapping[str, Kind], unit: _Unit) -> None:
        self.kinds, self.unit, self.returned, self.promoted = dict(given), unit, WHOLE, False

    def block(self, statements: list[ast.stmt], depth: int) -> list[str]:
        """Lines of C, indented."""
        return [
            "    " * depth + line
            for one in statements
            for line in getattr(self, f"_{type(one).__name__.lower()}", self._none)(one)
        ]

    def _none(self, node: ast.AST) -> NoReturn:
        raise ValueError(f"cannot be translated to C: {ast.unparse(node)}")

    def _inner(self, statements: list[ast.stmt]) -> list[str]:
        return ["{", *self.block(statements, 1), "}"]

    def _word(self, node: ast.Pass | ast.Continue | ast.Break) -> list[str]:
        return [] if isinstance(node, ast.Pass) else [f"{type(node).__name__.lower()};"]

    _pass = _continue = _break = _word

    def _return(self, node: ast.Return) -> list[str]:
        assert node.value is not None
        code, kind = self.of(node.value)
        self.returned = NUMBER if NUMBER in (self.returned, kind) else WHOLE
        return [f"return {code};"]

    def _while(self, node: ast.While) -> list[str]:
        return [f"while ({self.of(node.test)[0]})", *self._inner(node.body)]

    def _if(self, node: ast.If) -> list[str]:
        other = ["else", *self._inner(node.orelse)] if node.orelse else []
        return [f"if ({self.of(node.test)[0]})", *self._inner(node.body), *other]

    def _for(self, node: ast.For) -> list[str]:
        assert isinstance(node.target, ast.Name) and isinstance(node.iter, ast.Call)
        edges = [self.of(a)[0] for a in node.iter.args]
        first, end, step = [*([] if len(edges) > 1 else ["0"]), *edges, "1"][:3]
        i = f"{node.target.id}_"
        self._keep(node.target.id, WHOLE)
        head = f"for ({i} = {first}; {i} < {end}; {i} += {step})"
        return [head, *self._inner(node.body)]

    def _augassign(self, node: ast.AugAssign) -> list[str]:
        target = self.of(node.target)[0]
        return [f"{target} {_SIGNS[type(node.op)]}= {self.of(node.value)[0]};"]

    def _assign(self, node: ast.Assign) -> list[str]:
        (target,) = node.targets
        if not isinstance(target, ast.Tuple):
            return self._set(target, node.value)
        assert isinstance(node.value, ast.Tuple)
        lines, moves = [], []  # all are computed from the values before the assignment
        for i, (to, value) in enumerate(zip(target.elts, node.value.elts, strict=True)):
            code, kind = self.of(value)
            if not isinstance(to, ast.Name) or kind.shape:
                lines += self._set(to, value)
                continue
            self._keep(to.id, kind)
            lines += [f"{_TYPES[kind.of]} new{i} = {code};"]
            moves += [f"{to.id}_ = new{i};"]
        return ["{", *lines, *moves, "}"]

    def _set(self, target: ast.expr, value: ast.expr) -> list[str]:
        if not isinstance(target, ast.Name):
            return [f"{self.of(target)[0]} = {self.of(value)[0]};"]
        if isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute):
            return self._zeros(target.id, *value.args)
        code, kind = self.of(value)
        self._keep(target.id, kind)
        return [f"{target.id}_ = {code};"]

    def _zeros(self, name: str, size: ast.expr, *of: ast.expr) -> list[str]:
        """``np.zeros``, on the stack."""
        kind, many = "i" if of else "d", self.of(size)[0]
        self._keep(name, Kind(kind, (many,)))
        room = f"{name}_room"
        lines = [f"{_TYPES[kind]} {room}[{many}];", f"memset({room}, 0, sizeof {room});"]
        return [*lines, f"{name}_ = {room};"]

    def _keep(self, name: str, kind: Kind) -> None:
        if self.kinds.setdefault(name, kind) == WHOLE and kind == NUMBER:
            self.kinds[name], self.promoted = NUMBER, True

    def of(self, node: ast.expr) -> Value:
        """An expression and its kind."""
        return getattr(self, f"_{type(node).__name__.lower()}", self._none)(node)

    def _constant(self, node: ast.Constant) -> Value:
        if isinstance(node.value, float):
            return repr(node.value), NUMBER
        return str(int(node.value)), WHOLE  # pyrefly: ignore[bad-argument-type]

    def _name(self, node: ast.Name) -> Value:
        if node.id in _CONSTANTS:
            return _CONSTANTS[node.id], NUMBER
        if node.id not in self.kinds and node.id in self.unit.numbers:
            return self.of(self.unit.numbers[node.id])
        return f"{node.id}_", self.kinds[node.id]

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        code, kind = self.of(node.operand)
        return f"({_SIGNS[type(node.op)]}{code})", kind

    def _binop(self, node: ast.BinOp) -> Value:
        (a, one), (b, two) = self.of(node.left), self.of(node.right)
        if isinstance(node.op, ast.Div):
            return f"((double){a} / {b})", NUMBER
        return f"({a} {_SIGNS[type(node.op)]} {b})", one if one == two else NUMBER

    def _boolop(self, node: ast.BoolOp) -> Value:
        return f"({f' {_SIGNS[type(node.op)]} '.join(self.of(v)[0] for v in node.values)})", WHOLE

    def _compare(self, node: ast.Compare) -> Value:
        (op,), (right,) = node.ops, node.comparators
        return f"({self.of(node.left)[0]} {_SIGNS[type(op)]} {self.of(right)[0]})", WHOLE

    def _ifexp(self, node: ast.IfExp) -> Value:
        (a, one), (b, two) = self.of(node.body), self.of(node.orelse)
        return f"({self.of(node.test)[0]} ? {a} : {b})", one if one == two else NUMBER

    def _call(self, node: ast.Call) -> Value:
        assert isinstance(node.func, ast.Name)
        if node.func.id == "len":
            return self.of(node.args[0])[1].shape[0], WHOLE
        values, name = [self.of(a) for a in node.args], node.func.id
        if name in self.unit.functions:  # of the text: it takes every number as a double
            if name not in self.unit.returns:
                self.unit.add(name, [NUMBER] * len(values))
            return f"{name}_({', '.join(code for code, _ in values)})", self.unit.returns[name]
        given, name = [code for code, _ in values], _CALLS.get(name, name)
        while name in ("most", "least") and len(given) > 2:
            given[:2] = [f"{name}({given[0]}, {given[1]})"]
        return f"{name}({', '.join(given)})", WHOLE if name == "isfinite" else NUMBER

    def _subscript(self, node: ast.Subscript) -> Value:
        (name, kind), at = self.of(node.value), self.of(node.slice)[0]
        rest = kind.shape[1:]
        if not rest:
            return f"{name}[{at}]", Kind(kind.of)
        return f"({name} + ({at}) * {' * '.join(rest)})", Kind(kind.of, rest)


# runs as fast as with -O2, and is compiled in two thirds of its time
PLAIN = ("-O1", "-fPIC", "-shared", "-fno-math-errno", "-fno-trapping-math")
PLAIN += ("-Werror=implicit-function-declaration",)
# FUSED and WIDE may round a product and a sum once: values then depend on the machine
FUSED = (*PLAIN, "-mfma")
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
    floats, whole numbers, arrays in C order. ``flags`` other than PLAIN need :func:`has_wide`.
    With a name, what cannot be compiled runs as plain Python."""

    def __init__(self, source: str, flags: tuple[str, ...] = PLAIN, name: str = "") -> None:
        self.source, self.flags, self.name = source, flags, name
        self._lock, self._made = threading.Lock(), dict[tuple[Any, ...], Any]()
        self._plain: Any = None

    def __call__(self, *arguments: Any) -> int:
        if self._plain:
            return self._plain(*arguments)
        forms = tuple(
            [(a.dtype, a.ndim) if isinstance(a, np.ndarray) else type(a) for a in arguments]
        )
        run = self._made.get(forms)
        if run is None:
            try:
                with self._lock:
                    run = self._made[forms] = self._compiled(arguments)
            except (OSError, InputError) as error:
                if not self.name:
                    raise
                self._plain = getattr(_plain(self.source, self.name, error), self.name)
                return self._plain(*arguments)
        return run(*[part for i, a in enumerate(arguments) for part in _passed(i, a)])

    def _compiled(self, arguments: Sequence[Any]) -> Any:
        kinds = tuple(_kind(i, a) for i, a in enumerate(arguments))
        pairs = [(name, ", double" * (name == "pow")) for name in LIBRARY]
        known = "\n".join(_KNOWN.format(*pair) for pair in pairs) if self.flags == WIDE else ""
        return _loaded(c_code(self.source, kinds, known), kinds, self.flags)


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
        with whole(place, 0o600) as part:
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
    with whole(made, 0o600) as part:
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
PYTHON_HEADER = """import numpy as np


def fast(function):
    return function


small = fast
"""
HEADERS: Mapping[str, str] = {
    "numba": SCALAR_HEADER + NUMBA_HEADER,
    "python": SCALAR_HEADER + PYTHON_HEADER,
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
    those that only these call. ``backend`` is "numba", "python" (not compiled), or, for the last
    function in C, "c", "fused" (a product and a sum are rounded once) or "wide"."""
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
                    module.__dict__[last] = Native(text, FLAGS[backend], last)
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
    """The number of threads for compiled code: $NUMBA_NUM_THREADS, else the processors."""
    if getattr(_THREAD, "alone", False):
        return 1
    asked = os.environ.get("NUMBA_NUM_THREADS", "")
    return max(1, int(asked)) if asked.isdigit() else processors()


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
