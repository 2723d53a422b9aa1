"""The operations of an expression graph: value, code for a number, code for arrays, derivative."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


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
