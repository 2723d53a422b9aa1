"""Expression graphs: every distinct expression of scalars exists once, as a node.

Equal expressions are the same object, arguments have lower indices than their users, and
simplifications do not change the value by even one bit for finite arguments. Derivatives and
affine forms are expressions of the same graph.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .numpy_protocol import CHOICES, OPS, Symbolic


class Node(Symbolic):
    """A constant, a symbol, or an operation on other nodes."""

    __slots__ = ("graph", "op", "args", "value", "index")
    __hash__ = object.__hash__  # pyright: ignore[reportAssignmentType]

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
                return self.constant(OPS[op].value(*(a.value for a in nodes)))
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


def _where(condition: Node, yes: Node, no: Node) -> Node | None:
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
    "where": _where,
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
    return args[0][node.value] if node.op == "item" else OPS[node.op].value(*args)


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
    partials = OPS[node.op].partials
    if partials is None:
        return zero
    if node.op == "divide":  # (a' - (a/b) b') / b: one division
        return (inner[0] - node * inner[1]) / node.args[1]
    outer = partials(node, *node.args)
    return node.graph.total(
        o * s for o, s in zip(outer, inner, strict=True) if o is not None and s is not zero
    )


def jacobian(roots: Sequence[Node], variables: Sequence[Node]) -> list[list[Node]]:
    """Rows are roots, columns variables."""
    columns = [derivatives(roots, v) for v in variables]
    return [list(row) for row in zip(*columns, strict=True)] if variables else [[] for _ in roots]


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
