"""Expression graphs: every distinct expression of scalars exists once, as a node.

Equal expressions are the same object, arguments have lower indices than their users, and
simplifications do not change the value by even one bit for finite arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin


def _power_partials(result: Any, base: Any, exponent: Any) -> tuple[Any, Any]:
    """At a base of 0, where |w|^p has no slope for p < 1 and log has no value, both are 0."""
    if exponent.is_constant() and exponent.value >= 1.0:
        return exponent * base ** (exponent.value - 1.0), None
    zero = np.equal(base, 0.0)
    safe = np.where(zero, 1.0, base)
    slope = np.where(zero, 0.0, exponent * result / safe)
    return slope, None if exponent.is_constant() else np.where(zero, 0.0, result * np.log(safe))


def _sqrt_partial(result: Any, argument: Any) -> tuple[Any]:
    """0 at 0, as of a power below 1: there it has no slope."""
    zero = np.equal(result, 0.0)
    return (np.where(zero, 0.0, 0.5 / np.where(zero, 1.0, result)),)


# operations by the name of the NumPy function that defines them: code for floats, with functions
# of ``math`` by bare name, and the derivative for each argument, from the result and the arguments
PLAIN = "exp expm1 log log1p log10 sqrt sin cos tan sinh cosh tanh".split()
OPS: dict[str, str] = {name: f"{name}({{0}})" for name in PLAIN} | {
    "add": "{0} + {1}",
    "subtract": "{0} - {1}",
    "multiply": "{0} * {1}",
    "divide": "{0} / {1}",
    "negative": "-{0}",
    "power": "pow({0}, {1})",
    "arcsin": "asin({0})",
    "arccos": "acos({0})",
    "arctan": "atan({0})",
    "arctan2": "atan2({0}, {1})",
    "absolute": "abs({0})",
    "sign": "(1.0 if {0} > 0.0 else (-1.0 if {0} < 0.0 else 0.0))",
    "floor": "floored({0})",
    "maximum": "({0} if {0} >= {1} or {0} != {0} else {1})",
    "minimum": "({0} if {0} <= {1} or {0} != {0} else {1})",
    "where": "({1} if {0} else {2})",
    "less": "{0} < {1}",
    "less_equal": "{0} <= {1}",
    "equal": "{0} == {1}",
    "logical_and": "({0} and {1})",
    "logical_or": "({0} or {1})",
    "logical_not": "(not {0})",
}
PARTIALS: dict[str, Callable[..., tuple[Any, ...]]] = {
    "add": lambda r, a, b: (1.0, 1.0),
    "subtract": lambda r, a, b: (1.0, -1.0),
    "multiply": lambda r, a, b: (b, a),
    "negative": lambda r, a: (-1.0,),
    "power": _power_partials,
    "exp": lambda r, a: (r,),
    "expm1": lambda r, a: (r + 1.0,),
    "log": lambda r, a: (1.0 / a,),
    "log1p": lambda r, a: (1.0 / (1.0 + a),),
    "log10": lambda r, a: (1.0 / (np.log(10.0) * a),),
    "sqrt": _sqrt_partial,
    "sin": lambda r, a: (np.cos(a),),
    "cos": lambda r, a: (-np.sin(a),),
    "tan": lambda r, a: (1.0 + r * r,),
    "sinh": lambda r, a: (np.cosh(a),),
    "cosh": lambda r, a: (np.sinh(a),),
    "tanh": lambda r, a: (1.0 - r * r,),
    "arcsin": lambda r, a: (1.0 / np.sqrt(1.0 - a * a),),
    "arccos": lambda r, a: (-1.0 / np.sqrt(1.0 - a * a),),
    "arctan": lambda r, a: (1.0 / (1.0 + a * a),),
    "arctan2": lambda r, a, b: (b / (a * a + b * b), -a / (a * a + b * b)),
    "absolute": lambda r, a: (np.sign(a),),
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


_UNARY = [k for k in OPS if getattr(getattr(np, k), "nin", 0) == 1]
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


def _round(value: Any, decimals: Any = 0, **options: Any) -> Any:
    scale = 10.0 ** int(decimals)
    return np.rint(_listed(value) * scale) / scale if decimals else np.rint(_listed(value))


def _listed(value: Any) -> Any:
    return signal_array(value) if isinstance(value, (list, tuple)) else value


FUNCTIONS = {
    np.where: _where,
    np.clip: _clip,
    np.interp: _interp,
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


class Node(Symbolic):
    """A constant, a symbol, or an operation on other nodes."""

    __slots__ = ("graph", "op", "args", "value", "index")
    __hash__ = object.__hash__

    def __init__(self, graph: Graph, op: str, args: tuple[Node, ...], value: Any) -> None:
        self.graph, self.op, self.args, self.value = graph, op, args, value
        self.index = len(graph.nodes)

    def is_constant(self, value: float | None = None) -> bool:
        return self.op == "constant" and (value is None or self.value == value)

    def __repr__(self) -> str:
        if self.op in ("constant", "symbol"):
            return str(self.value)
        return f"{self.op}({', '.join(map(repr, self.args))})"


class Graph:
    """The table of nodes. ``late`` are delays by the state that is the delayed signal; of those in
    ``exact`` the rate is the signal before the delay. ``called`` are called by nodes "call"."""

    def __init__(self) -> None:
        self.called: list[Callable[..., Sequence[float]]] = []
        self.late: dict[int, Any] = {}
        self.exact: frozenset[int] = frozenset()
        self.nodes: list[Node] = []
        self._table: dict[Any, Node] = {}

    def _node(self, op: str, args: tuple[Node, ...] = (), value: Any = None) -> Node:
        key = (op, value, *(a.index for a in args))
        node = self._table.get(key)
        if node is None:
            node = Node(self, op, args, value)
            self.nodes.append(node)
            self._table[key] = node
        return node

    def constant(self, value: float) -> Node:
        value = float(value)
        return self._node("constant", (), value if value == value else np.nan)

    def symbol(self, name: str) -> Node:
        return self._node("symbol", (), name)

    def make(self, op: str, *args: Any) -> Node:
        """The node of an operation, simplified; numbers become constants."""
        nodes = tuple(a if isinstance(a, Node) else self.constant(a) for a in args)
        if all(a.op == "constant" for a in nodes):
            with np.errstate(all="ignore"):
                return self.constant(getattr(np, op)(*(a.value for a in nodes)))
        simpler = SIMPLER[op](*nodes) if op in SIMPLER else None
        return self._node(op, nodes) if simpler is None else simpler

    def like(self, node: Node, args: tuple[Node, ...]) -> Node:
        """The same operation on other arguments."""
        if node.op in ("call", "item"):
            return self._node(node.op, args, node.value)
        return self.make(node.op, *args)

    def call(self, function: Callable[..., Sequence[float]], args: Sequence[Node]) -> Node:
        """A call of a function, of which ``result`` is the number i."""
        self.called.append(function)
        return self._node("call", tuple(args), len(self.called) - 1)

    def result(self, call: Node, i: int) -> Node:
        return self._node("item", (call,), i)

    def total(self, terms: Iterable[Any]) -> Node:
        """Sum, from left to right."""
        result = self.constant(0.0)
        for term in terms:
            result = self.make("add", result, term)
        return result


def _ordered(op: str, a: Node, b: Node) -> Node | None:
    """A commutative operation with its arguments in a fixed order."""
    return None if a.index <= b.index else a.graph.make(op, b, a)


def _add(a: Node, b: Node) -> Node | None:
    if a.is_constant(0.0):
        return b
    if b.is_constant(0.0):
        return a
    if b.op == "negative":
        return a - b.args[0]
    if a.op == "negative":
        return b - a.args[0]
    return _ordered("add", a, b)


def _subtract(a: Node, b: Node) -> Node | None:
    if b.is_constant(0.0):
        return a
    if a.is_constant(0.0):
        return -b
    if a is b:
        return a.graph.constant(0.0)
    return a + b.args[0] if b.op == "negative" else None


def _multiply(a: Node, b: Node) -> Node | None:
    for one, other in ((a, b), (b, a)):
        if one.is_constant(0.0):
            return one
        if one.is_constant(1.0):
            return other
        if one.is_constant(-1.0):
            return -other
        if one.op == "negative":
            return -(one.args[0] * other)
    return _ordered("multiply", a, b)


def _divide(a: Node, b: Node) -> Node | None:
    if a.is_constant(0.0) or b.is_constant(1.0):
        return a
    if b.is_constant(-1.0):
        return -a
    return -(a.args[0] / b) if a.op == "negative" else None


def _power(a: Node, b: Node) -> Node | None:
    powers: dict[float, Callable[[], Any]] = {
        0.0: lambda: a.graph.constant(1.0),
        0.5: lambda: np.sqrt(a),
        1.0: lambda: a,
        2.0: lambda: a * a,
        3.0: lambda: a * a * a,
        -1.0: lambda: 1.0 / a,
    }
    return powers[b.value]() if b.op == "constant" and b.value in powers else None


def _chosen(condition: Node, yes: Node, no: Node) -> Node | None:
    if yes is no:
        return yes
    if condition.op == "constant":
        return yes if condition.value else no
    return None


SIMPLER: dict[str, Callable[..., Node | None]] = {
    "add": _add,
    "subtract": _subtract,
    "multiply": _multiply,
    "divide": _divide,
    "power": _power,
    "negative": lambda a: a.args[0] if a.op == "negative" else None,
    "absolute": lambda a: (
        abs(a.args[0]) if a.op == "negative" else a if a.op == "absolute" else None
    ),
    "where": _chosen,
}


def reachable(roots: Iterable[Node]) -> list[Node]:
    """All nodes that the roots need, arguments before users."""
    found: dict[int, Node] = {}
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node.index not in found:
            found[node.index] = node
            stack.extend(node.args)
    return [found[i] for i in sorted(found)]


def outline(groups: Sequence[Sequence[Node]]) -> tuple[Any, ...]:
    """What groups of nodes say, as a hashable value, constants to the last bit."""
    nodes = reachable(node for group in groups for node in group)
    place = {node.index: i for i, node in enumerate(nodes)}
    rows = tuple(
        (n.op, n.value if n.op == "symbol" else None, *(place[a.index] for a in n.args))
        for n in nodes
    )
    constants = np.array([n.value for n in nodes if n.op == "constant"], dtype=float)
    places = tuple(tuple(place[node.index] for node in group) for group in groups)
    return rows, constants.tobytes(), places


def substitute(
    roots: Sequence[Node], rule: Callable[[Node, tuple[Node, ...]], Node | None]
) -> list[Node]:
    """The roots with nodes replaced: ``rule(node, new_arguments)`` gives the new node or None."""
    new: dict[int, Node] = {}
    for node in reachable(roots):
        args = tuple(new[a.index] for a in node.args)
        changed = rule(node, args)
        if changed is None:
            same = all(a is b for a, b in zip(args, node.args, strict=True))
            changed = node if same else node.graph.like(node, args)
        new[node.index] = changed
    return [new[root.index] for root in roots]


def sharp(
    roots: Sequence[Node], widths: Sequence[Node], of: Sequence[Node] | None = None
) -> list[Node]:
    """The roots with sign(x) for tanh(x/p), p one of ``widths``; x one of ``of``, None: any."""
    narrow = {node.index for node in widths}
    where = None if of is None else {node.index for node in of}

    def rule(node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.op != "tanh" or node.args[0].op != "divide":
            return None
        x, width = node.args[0].args
        if width.index not in narrow or not (where is None or x.index in where):
            return None
        return node.graph.make("sign", args[0].args[0])

    return substitute(roots, rule)


def rename(roots: Sequence[Node], to: Mapping[int, Node]) -> list[Node]:
    """The roots with symbols replaced; ``to`` is keyed by the symbol's index."""
    return substitute(roots, lambda node, args: to.get(node.index))


def symbols_in(roots: Iterable[Node]) -> set[str]:
    return {node.value for node in reachable(roots) if node.op == "symbol"}


def evaluate(roots: Sequence[Node], values: Mapping[str, Any]) -> list[Any]:
    """Values of the roots, node by node with NumPy; symbols by name, broadcast."""
    known: dict[int, Any] = {}
    with np.errstate(all="ignore"):
        for node in reachable(roots):
            if node.op == "constant":
                known[node.index] = np.float64(node.value)
            elif node.op == "symbol":
                known[node.index] = np.asarray(values[node.value], dtype=float)[()]
            else:
                known[node.index] = _value(node, [known[a.index] for a in node.args])
    return [known[root.index] for root in roots]


def _value(node: Node, args: Sequence[Any]) -> Any:
    if node.op == "call":
        return node.graph.called[node.value](*args)
    return args[0][node.value] if node.op == "item" else getattr(np, node.op)(*args)


def derivatives(roots: Sequence[Node], variable: Node) -> list[Node]:
    """d root / d variable for each root; sign and comparisons count as constants."""
    slope: dict[int, Node] = {}
    zero, one = variable.graph.constant(0.0), variable.graph.constant(1.0)
    for node in reachable(roots):
        inner = [slope[a.index] for a in node.args]
        if node is variable:
            slope[node.index] = one
        elif all(s is zero for s in inner):
            slope[node.index] = zero
        else:
            slope[node.index] = _chain(node, inner, zero)
    return [slope[root.index] for root in roots]


def _chain(node: Node, inner: list[Node], zero: Node) -> Node:
    if node.op in CHOICES:
        condition, _, _ = CHOICES[node.op](*node.args)
        return node.graph.make("where", condition, *inner[-2:])
    if node.op == "divide":  # (a' - (a/b) b') / b: one division
        return (inner[0] - node * inner[1]) / node.args[1]
    if node.op not in PARTIALS:
        return zero
    outer = PARTIALS[node.op](node, *node.args)
    return node.graph.total(
        o * s for o, s in zip(outer, inner, strict=True) if o is not None and s is not zero
    )


@dataclass(frozen=True)
class Form:
    """offset + sum of slopes times symbols; ``slopes`` by the symbol's index, zeros left out."""

    slopes: dict[int, Node]
    offset: Node


def affine(roots: Sequence[Node], symbols: Iterable[Node]) -> list[Form | None]:
    """Each root as an affine form of the symbols, None where it is not affine by its operations
    alone, so for all values of all other symbols."""
    forms: dict[int, Form | None] = {}
    own = {node.index for node in symbols}
    for node in reachable(roots):
        graph, parts = node.graph, [forms[a.index] for a in node.args]
        if node.index in own:
            forms[node.index] = Form({node.index: graph.constant(1.0)}, graph.constant(0.0))
        elif all(part is not None and not part.slopes for part in parts):
            # arguments may be new: in x - x and 0 x a symbol has cancelled
            args = [part.offset for part in parts if part]
            same = all(a.index == b.index for a, b in zip(node.args, args, strict=True))
            forms[node.index] = Form({}, node if same else graph.like(node, tuple(args)))
        elif None in parts or node.op not in _RULES:
            forms[node.index] = None
        else:
            forms[node.index] = _RULES[node.op](*parts)
    return [forms[root.index] for root in roots]


def _each(function: Callable[..., Node], *forms: Form) -> Form:
    """The same linear operation on the offsets and on the slopes of each symbol."""
    keys = dict.fromkeys(k for form in forms for k in form.slopes)
    zero = forms[0].offset.graph.constant(0.0)
    slopes = {k: function(*(form.slopes.get(k, zero) for form in forms)) for k in keys}
    kept = {k: slope for k, slope in slopes.items() if not slope.is_constant(0.0)}
    return Form(kept, function(*(form.offset for form in forms)))


def _product(a: Form, b: Form) -> Form | None:
    if a.slopes and b.slopes:
        return None
    fixed, free = (b, a) if a.slopes else (a, b)
    return _each(lambda part: part * fixed.offset, free)


def _choice(condition: Form, yes: Form, no: Form) -> Form | None:
    if condition.slopes:
        return None
    make = condition.offset.graph.make
    return _each(lambda a, b: make("where", condition.offset, a, b), yes, no)


_RULES: dict[str, Callable[..., Form | None]] = {
    "add": lambda a, b: _each(lambda x, y: x + y, a, b),
    "subtract": lambda a, b: _each(lambda x, y: x - y, a, b),
    "negative": lambda a: _each(lambda x: -x, a),
    "multiply": _product,
    "divide": lambda a, b: None if b.slopes else _each(lambda part: part / b.offset, a),
    "where": _choice,
}
