"""The operations of an expression graph, and how nodes answer to arithmetic and NumPy functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin


@dataclass(frozen=True)
class Op:
    """One operation: the NumPy function that defines it; code with ``{0}``, ``{1}`` for the
    arguments, for floats (``math`` functions by bare name, as numba compiles them) and for arrays
    (``np``); and ``partials(result, *arguments)``, the derivative for each argument, None for
    zero. None instead of a function: the operation is a choice or piecewise constant."""

    value: Callable[..., Any]
    scalar: str
    array: str
    partials: Callable[..., tuple[Any, ...]] | None = None


def _function(name: str, partial: Callable[[Any, Any], Any], scalar: str | None = None) -> Op:
    """A function of one argument that ``math`` and NumPy provide."""
    codes = f"{scalar or name}({{0}})", f"np.{name}({{0}})"
    return Op(getattr(np, name), *codes, lambda result, a: (partial(result, a),))


def _infix(function: Callable[..., Any], sign: str, partials: Any = None) -> Op:
    code = f"{{0}} {sign} {{1}}"
    return Op(function, code, code, partials)


def _power_partials(result: Any, base: Any, exponent: Any) -> tuple[Any, Any]:
    """At a base of 0, where |w|^p has no slope for p < 1 and log has no value, both are 0."""
    if exponent.is_constant() and exponent.value >= 1.0:
        return exponent * base ** (exponent.value - 1.0), None
    zero = np.equal(base, 0.0)
    safe = np.where(zero, 1.0, base)
    slope = np.where(zero, 0.0, exponent * result / safe)
    return slope, None if exponent.is_constant() else np.where(zero, 0.0, result * np.log(safe))


def _sqrt_partial(result: Any, argument: Any) -> Any:
    """0 at 0, as of a power below 1: there it has no slope."""
    zero = np.equal(result, 0.0)
    return np.where(zero, 0.0, 0.5 / np.where(zero, 1.0, result))


OPS: dict[str, Op] = {
    "add": _infix(np.add, "+", lambda r, a, b: (1.0, 1.0)),
    "subtract": _infix(np.subtract, "-", lambda r, a, b: (1.0, -1.0)),
    "multiply": _infix(np.multiply, "*", lambda r, a, b: (b, a)),
    "divide": _infix(np.divide, "/", lambda r, a, b: (1.0 / b, -r / b)),
    "negative": Op(np.negative, "-{0}", "-{0}", lambda r, a: (-1.0,)),
    "power": Op(np.power, "pow({0}, {1})", "np.power({0}, {1})", _power_partials),
    "exp": _function("exp", lambda r, a: r),
    "expm1": _function("expm1", lambda r, a: r + 1.0),
    "log": _function("log", lambda r, a: 1.0 / a),
    "log1p": _function("log1p", lambda r, a: 1.0 / (1.0 + a)),
    "log10": _function("log10", lambda r, a: 1.0 / (np.log(10.0) * a)),
    "sqrt": _function("sqrt", _sqrt_partial),
    "sin": _function("sin", lambda r, a: np.cos(a)),
    "cos": _function("cos", lambda r, a: -np.sin(a)),
    "tan": _function("tan", lambda r, a: 1.0 + r * r),
    "sinh": _function("sinh", lambda r, a: np.cosh(a)),
    "cosh": _function("cosh", lambda r, a: np.sinh(a)),
    "tanh": _function("tanh", lambda r, a: 1.0 - r * r),
    "arcsin": _function("arcsin", lambda r, a: 1.0 / np.sqrt(1.0 - a * a), "asin"),
    "arccos": _function("arccos", lambda r, a: -1.0 / np.sqrt(1.0 - a * a), "acos"),
    "arctan": _function("arctan", lambda r, a: 1.0 / (1.0 + a * a), "atan"),
    "arctan2": Op(
        np.arctan2,
        "atan2({0}, {1})",
        "np.arctan2({0}, {1})",
        lambda r, a, b: (b / (a * a + b * b), -a / (a * a + b * b)),
    ),
    "absolute": _function("absolute", lambda r, a: np.sign(a), "abs"),
    "sign": Op(np.sign, "(1.0 if {0} > 0.0 else (-1.0 if {0} < 0.0 else 0.0))", "np.sign({0})"),
    "floor": Op(np.floor, "floored({0})", "np.floor({0})"),
    "maximum": Op(np.maximum, "({0} if {0} >= {1} or {0} != {0} else {1})", "np.maximum({0}, {1})"),
    "minimum": Op(np.minimum, "({0} if {0} <= {1} or {0} != {0} else {1})", "np.minimum({0}, {1})"),
    "where": Op(np.where, "({1} if {0} else {2})", "np.where({0}, {1}, {2})"),
    "less": _infix(np.less, "<"),
    "less_equal": _infix(np.less_equal, "<="),
    "equal": _infix(np.equal, "=="),
    "logical_and": Op(np.logical_and, "({0} and {1})", "np.logical_and({0}, {1})"),
    "logical_or": Op(np.logical_or, "({0} or {1})", "np.logical_or({0}, {1})"),
    "logical_not": Op(np.logical_not, "(not {0})", "np.logical_not({0})"),
}

WIDTH = 8  # numbers computed at once, if the processor supports it
LIBRARY = ("cos", "exp", "log", "pow", "sin")  # functions of a C library for several numbers

COMPARISONS = {"less", "less_equal"}

# choices between two branches: condition, branch if it holds, branch if not
CHOICES: dict[str, Callable[..., tuple[Any, Any, Any]]] = {
    "where": lambda c, a, b: (c, a, b),
    "maximum": lambda a, b: (a >= b, a, b),
    "minimum": lambda a, b: (a <= b, a, b),
}

# ufuncs written with the operations above: name -> function of nodes
DERIVED: dict[str, Callable[..., Any]] = {
    "fabs": lambda a: abs(a),
    "square": lambda a: a * a,
    "reciprocal": lambda a: 1.0 / a,
    "positive": lambda a: a,
    "ceil": lambda a: -np.floor(-a),
    "trunc": lambda a: where(a < 0.0, -np.floor(-a), np.floor(a)),
    "rint": lambda a: _rint(a),
    "remainder": lambda a, b: a - b * np.floor(a / b),
    "fmod": lambda a, b: a - b * np.trunc(a / b),
    "floor_divide": lambda a, b: np.floor(a / b),
    "hypot": lambda a, b: np.sqrt(a * a + b * b),
    "float_power": lambda a, b: np.power(a, b),
    "greater": lambda a, b: np.less(b, a),
    "greater_equal": lambda a, b: np.less_equal(b, a),
    "not_equal": lambda a, b: np.logical_not(np.equal(a, b)),
    "bitwise_and": lambda a, b: np.logical_and(a, b),
    "bitwise_or": lambda a, b: np.logical_or(a, b),
    "invert": lambda a: np.logical_not(a),
    "heaviside": lambda a, b: where(a < 0.0, 0.0, where(np.equal(a, 0.0), b, 1.0)),
    "clip": lambda a, low, high: np.minimum(np.maximum(a, low), high),
    "fmax": lambda a, b: np.maximum(a, b),
    "fmin": lambda a, b: np.minimum(a, b),
} | {
    **dict.fromkeys(("degrees", "rad2deg"), lambda a: a * (180.0 / np.pi)),
    **dict.fromkeys(("radians", "deg2rad"), lambda a: a * (np.pi / 180.0)),
}


def _rint(a: Any) -> Any:
    """The nearest whole number; of two the even one."""
    up = np.floor(a + 0.5)
    tie = np.logical_and(np.equal(up - a, 0.5), np.less(0.25, up - 2.0 * np.floor(0.5 * up)))
    return where(tie, up - 1.0, up)


def where(condition: Any, yes: Any, no: Any) -> Any:
    """np.where on a node."""
    return condition.graph.make("where", condition, yes, no)


WITH = "arithmetic, np.where, np.sign, np.abs, np.clip, np.interp, np.exp, np.sin and their like"
POINTS = 50  # most points of np.interp: steps end at each, and each takes time to compile


class TraceError(TypeError):
    """A block's function cannot be traced symbolically."""


class Symbolic(NDArrayOperatorsMixin):
    """Behaviour of a node inside a block's function."""

    __slots__ = ()
    graph: Any

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return apply_ufunc(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return apply_function(function, args, options)

    def __bool__(self) -> NoReturn:
        raise TraceError(
            "a Python branch (if, and, or, min, max) depends on a signal; "
            "write np.where, np.minimum or np.maximum"
        )

    def __float__(self) -> NoReturn:
        raise TraceError(
            "a signal is turned into a number (float(), math.*, or an entry of a float array); "
            "write np.* functions and np.array([...])"
        )

    __int__ = __index__ = __complex__ = __float__

    def __round__(self, digits: Any = None) -> Any:
        return _round(self, digits or 0)

    def clip(self, low: Any = None, high: Any = None) -> Any:
        return _clip(self, low, high)


def _method(name: str) -> Any:
    """NumPy calls ``element.exp()`` for ``np.exp`` of an array of objects."""
    return lambda self: apply_ufunc(getattr(np, name), "__call__", (self,), {})


_UNARY = [k for k, op in OPS.items() if isinstance(op.value, np.ufunc) and op.value.nin == 1]
_UNARY += "ceil rint trunc square reciprocal fabs degrees radians deg2rad rad2deg".split()
for _name in _UNARY:
    setattr(Symbolic, _name, _method(_name))
for _name in ("floor", "ceil", "trunc"):  # for functions of math
    setattr(Symbolic, f"__{_name}__", _method(_name))


class SignalArray(np.ndarray):
    """An array of nodes that applies ufuncs and FUNCTIONS to its nodes."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or ufunc is np.matmul:
            plain = (np.asarray(a) if isinstance(a, np.ndarray) else a for a in inputs)
            return signal_array(getattr(ufunc, method)(*plain, **options))
        return apply_ufunc(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        if function in FUNCTIONS:
            return apply_function(function, args, options)
        return super().__array_function__(function, types, args, options)


def signal_array(values: Any) -> Any:
    """The nodes as a SignalArray; a single node is returned as it is."""
    if isinstance(values, Symbolic):
        return values
    array = np.empty(np.shape(values), dtype=object)
    array[...] = values
    return array.view(SignalArray)


def apply_ufunc(ufunc: np.ufunc, method: str, inputs: Any, options: dict[str, Any]) -> Any:
    """A ufunc on nodes, element by element for arrays."""
    out = options.pop("out", None)
    if method != "__call__" or options:
        raise TraceError(f"np.{ufunc.__name__}.{method} with options cannot be traced")
    if out is None and not any(isinstance(a, (np.ndarray, list, tuple)) for a in inputs):
        return _scalar(ufunc.__name__, inputs)
    inputs = [_listed(a) for a in inputs]
    result = _elementwise(lambda *args: _scalar(ufunc.__name__, args), inputs)
    if out is not None and isinstance(out[0], np.ndarray):
        out[0][...] = result
        return out[0]
    return result


def _scalar(name: str, args: Any) -> Any:
    node = next((a for a in args if isinstance(a, Symbolic)), None)
    if node is None:
        return getattr(np, name)(*args)
    if name in DERIVED:
        return DERIVED[name](*args)
    if name not in OPS:
        raise TraceError(f"np.{name} of a signal cannot be traced; write it with {WITH}")
    return node.graph.make(name, *args)


def _elementwise(function: Any, inputs: Any) -> Any:
    if not any(isinstance(a, np.ndarray) and a.ndim for a in inputs):
        return function(*(a[()] if isinstance(a, np.ndarray) else a for a in inputs))
    cells = np.broadcast(*(_cell(a) for a in inputs))
    result = np.empty(cells.shape, dtype=object)
    for place, values in enumerate(cells):
        result.flat[place] = function(*values)
    return result.view(SignalArray)


def _cell(value: Any) -> np.ndarray:
    if isinstance(value, np.ndarray):
        return value.view(np.ndarray)
    cell = np.empty((), dtype=object)
    cell[()] = value
    return cell


def _where(condition: Any, yes: Any, no: Any) -> Any:
    def choose(c: Any, a: Any, b: Any) -> Any:
        if not isinstance(c, Symbolic):
            return a if c else b
        return c.graph.make("where", c, a, b)

    return _elementwise(choose, [_listed(a) for a in (condition, yes, no)])


def _clip(value: Any, low: Any = None, high: Any = None, **bounds: Any) -> Any:
    low, high = bounds.get("a_min", bounds.get("min", low)), bounds.get("a_max", high)
    high = bounds.get("max", high)
    value = value if low is None else np.maximum(value, low)
    return value if high is None else np.minimum(value, high)


def _interp(
    x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None
) -> Any:
    """np.interp by kinks: (f_1 + f_n)/2 + sum of (change of slope) |x - xp_i|/2, x clipped."""
    places, values = [float(v) for v in xp], list(fp)
    gaps = np.diff(places)
    if period is not None or np.any(gaps <= 0.0) or len(values) != len(places):
        raise TraceError(
            "np.interp is traced only without a period and with increasing points, one value each"
        )
    if len(places) > POINTS:
        raise TraceError(
            f"np.interp over {len(places)} points is not traced: give at most {POINTS}, or "
            "use lg.tabulated, which rounds the corners"
        )
    slopes = [(b - a) / gap for a, b, gap in zip(values, values[1:], gaps.tolist(), strict=False)]
    inside = np.clip(_listed(x), places[0], places[-1])
    result = 0.5 * (values[0] + values[-1]) + 0.0 * inside
    for place, before, after in zip(places, [0.0, *slopes], [*slopes, 0.0], strict=True):
        result = result + 0.5 * (after - before) * np.abs(inside - place)
    result = result if left is None else _where(x < places[0], left, result)
    return result if right is None else _where(x > places[-1], right, result)


def _select(conditions: Any, choices: Any, default: Any = 0.0) -> Any:
    """np.select: the first choice whose condition holds."""
    result = default
    for condition, choice in reversed([*zip(conditions, choices, strict=True)]):
        result = _where(condition, choice, result)
    return result


def _round(value: Any, decimals: Any = 0, **options: Any) -> Any:
    scale = 10.0 ** int(decimals)
    return np.rint(_listed(value) * scale) / scale if decimals else np.rint(_listed(value))


def _listed(value: Any) -> Any:
    return signal_array(value) if isinstance(value, (list, tuple)) else value


FUNCTIONS = {
    np.where: _where,
    np.clip: _clip,
    np.interp: _interp,
    np.select: _select,
    np.fix: lambda value, **options: np.trunc(_listed(value)),
} | {function: _round for function in (np.round, np.around)}


def apply_function(function: Any, args: Any, options: dict[str, Any]) -> Any:
    """A NumPy function on nodes: our own version, or NumPy's on an array of objects."""
    if function in FUNCTIONS:
        return FUNCTIONS[function](*args, **options)
    return function(*[_boxed(a) for a in args], **options)


def _boxed(value: Any) -> Any:
    if isinstance(value, Symbolic):
        return _cell(value).view(SignalArray)
    return [_boxed(v) for v in value] if isinstance(value, (list, tuple)) else value
