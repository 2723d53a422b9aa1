"""Kinks and jumps: how a step treats abs, sign, np.where and comparisons."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..expression.graph import Node, substitute, symbols_in
from ..expression.operations import COMPARISONS


def average_jumps(roots: Sequence[Node], fixed: set[str]) -> list[Node]:
    """For a step of fixed length: a condition on time alone is weighted by its share of the step.

    np.where(t >= t0, a, b) becomes b + s (a - b), where s is the part of [t, t + h] after t0;
    the result is then a continuous function of t0, and exact if t0 is on the grid. The start of
    the step is the symbol ``begin``, its length ``h``. ``fixed`` names the symbols (parameters)
    that a condition on time may contain.
    """
    shares: dict[int, Node] = {}

    def rule(node: Node, args: tuple[Node, ...]) -> Node | None:
        share = _share(node, args, shares, fixed)
        if share is not None:
            shares[node.index] = share
            return share
        if node.op == "where" and node.args[0].index in shares:
            return args[2] + args[0] * (args[1] - args[2])
        return None

    return substitute(roots, rule)


def _share(
    node: Node, args: tuple[Node, ...], shares: dict[int, Node], fixed: set[str]
) -> Node | None:
    """The share of the step in which a condition on time holds; None for any other node."""
    if node.op in COMPARISONS:
        names = symbols_in([node])
        timed = "t" in names and names <= fixed | {"t"}
        return _held_part(node.args[1] - node.args[0]) if timed else None
    if not any(a.index in shares for a in node.args):
        return None
    if node.op == "logical_not":
        return 1.0 - args[0]
    if node.op == "logical_and":
        return _number(node.args[0], args[0], shares) * _number(node.args[1], args[1], shares)
    if node.op == "logical_or":
        a, b = (_number(n, v, shares) for n, v in zip(node.args, args, strict=True))
        return a + b - a * b
    return None


def _number(old: Node, new: Node, shares: dict[int, Node]) -> Node:
    return new if old.index in shares else new.graph.make("where", new, 1.0, 0.0)


def _held_part(lead: Node) -> Node:
    """The part of the step in which ``lead`` >= 0, if it is linear over the step."""
    graph = lead.graph
    begin, h, t = graph.symbol("begin"), graph.symbol("h"), graph.symbol("t")
    first = substitute([lead], lambda n, args: begin if n is t else None)[0]
    last = substitute([lead], lambda n, args: begin + h if n is t else None)[0]
    change = last - first
    still = graph.make("where", first >= 0.0, 1.0, 0.0)
    above, before = graph.make("maximum", last, 0.0), graph.make("maximum", first, 0.0)
    part = (above - before) / change
    return graph.make("where", abs(change) > 0.0, part, still)


def freeze_modes(
    roots: Sequence[Node], fixed: set[str]
) -> tuple[list[Node], list[Node], list[bool]]:
    """For steps that end at each kink or jump: smooth roots and switching functions.

    Between two events each |a|, sign(a), comparison, maximum and minimum stays on one side. Its
    side is the symbol ``m0``, ``m1``, ... (+1, 0, -1, or nan), the sign of the switching function
    with the same number. Conditions on ``fixed`` symbols alone are not changed. The third result
    says which functions switch a jump rather than a kink.
    """
    leads: list[Node] = []
    jumps: set[int] = set()
    known: dict[int, Node] = {}

    def side(lead: Node, jump: bool) -> Node:
        # w > v and w < v switch together
        opposite = lead.args[1] - lead.args[0] if lead.op == "subtract" else -lead
        if opposite.index in known or lead.op == "negative":
            return -side(opposite, jump)
        if lead.index not in known:
            known[lead.index] = lead.graph.symbol(f"m{len(leads)}")
            leads.append(lead)
        jumps.update([lead.index] * jump)
        return known[lead.index]

    def rule(node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.op in _ROOTS and args[0] is not node.args[0]:
            # on its side m a may be negative where |a| is not, and a trial step beyond the switch
            # would be NaN: as far beyond it as the true argument is not negative
            frozen = args[0]
            inside = node.graph.make("where", node.args[0] >= 0.0, abs(frozen), frozen)
            return node.graph.make(node.op, inside, *args[1:])
        if node.op not in _SIDES or symbols_in([node]) <= fixed:
            return None
        make_lead, result = _SIDES[node.op]
        return result(side(make_lead(*args), node.op not in _KINKS), *args)

    smooth = substitute(roots, rule)
    return smooth, leads, [lead.index in jumps for lead in leads]


def _choose(mode: Node, yes: Node, no: Node) -> Node:
    """The value on the current side; yes + no if the mode is nan, so that a NaN remains."""
    make = mode.graph.make
    return make("where", mode > 0.0, yes, make("where", mode <= 0.0, no, yes + no))


def _floor(mode: Node, a: Node) -> Node:
    """The floor on its side, up to half a cell beyond: even for sin(pi a) > 0, else odd."""
    even = 2.0 * np.floor(0.5 * (a - 0.5) + 0.5)
    odd = 2.0 * np.floor(0.5 * (a - 1.5) + 0.5) + 1.0
    make = mode.graph.make
    return make("where", mode > 0.0, even, make("where", mode < 0.0, odd, np.floor(a + 0.5)))


_ROOTS = {"sqrt", "power", "log", "log1p", "log10"}
_KINKS = {"absolute", "maximum", "minimum"}

# operation: its switching function, and its value on the side m
_SIDES: dict[str, tuple[Callable[..., Node], Callable[..., Node]]] = {
    "absolute": (lambda a: a, lambda m, a: m * a),
    "sign": (lambda a: a, lambda m, a: m),
    "floor": (lambda a: np.sin(np.pi * a), _floor),
    "less": (lambda a, b: b - a, lambda m, a, b: m > 0.0),
    "less_equal": (lambda a, b: b - a, lambda m, a, b: m >= 0.0),
    "maximum": (lambda a, b: a - b, _choose),
    "minimum": (lambda a, b: b - a, _choose),
}
