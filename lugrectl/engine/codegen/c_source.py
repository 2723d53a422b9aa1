"""Translates generated loops to C, statement by statement, from a subset of Python."""

from __future__ import annotations

import ast
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

_HEADER = """#include <math.h>
#include <stdint.h>
#include <string.h>
static inline double most(double a, double b) { return b > a ? b : a; }
static inline double least(double a, double b) { return b < a ? b : a; }
"""
_TYPES = {"d": "double", "i": "int64_t"}
_SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.USub: "-", ast.Not: "!"}
_SIGNS |= {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_SIGNS |= {ast.And: "&&", ast.Or: "||", ast.Mod: "%"}  # the rest of counts, none below 0
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
            writer = _Writer(given, self, writer.kinds)
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

    def __init__(
        self, given: Mapping[str, Kind], unit: _Unit, known: Mapping[str, Kind] | None = None
    ) -> None:
        self.kinds: dict[str, Kind] = {**given, **(known or {})}
        self.unit, self.promoted, self.returned = unit, False, WHOLE

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
        before = self.kinds.get(name, kind)
        self.promoted |= before == WHOLE and kind == NUMBER
        self.kinds[name] = NUMBER if NUMBER in (before, kind) else kind

    def of(self, node: ast.expr) -> Value:
        """An expression and its kind."""
        return getattr(self, f"_{type(node).__name__.lower()}", self._none)(node)

    def _constant(self, node: ast.Constant) -> Value:
        if isinstance(node.value, float):
            return repr(node.value), NUMBER
        return str(int(node.value)), WHOLE  # pyright: ignore[reportArgumentType]

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
