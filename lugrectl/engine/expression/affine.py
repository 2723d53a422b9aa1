"""Affine expressions: which ones are affine in given symbols, and linear equations of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from .graph import Node, reachable


@dataclass(frozen=True)
class Form:
    """offset + sum of slopes times symbols; ``slopes`` by the symbol's index, zeros left out.

    Neither the offset nor a slope contains one of the symbols.
    """

    slopes: dict[int, Node]
    offset: Node


def affine(roots: Sequence[Node], symbols: Iterable[Node]) -> list[Form | None]:
    """Each root as an affine form of the symbols, None where it is not affine.

    Decided by the operations alone, so it holds for all values of all other symbols: parameters,
    inputs, time. A choice by a condition that is free of the symbols is affine if its branches
    are. An expression that is affine only after a rearrangement (a difference of two squares)
    counts as not affine.
    """
    forms: dict[int, Form | None] = {}
    own = {node.index for node in symbols}
    for node in reachable(roots):
        if node.index in own:
            forms[node.index] = Form({node.index: _number(node, 1.0)}, _number(node, 0.0))
            continue
        parts = [forms[a.index] for a in node.args]
        if all(part is not None and not part.slopes for part in parts):
            forms[node.index] = Form({}, _without(node, [part.offset for part in parts if part]))
        elif None in parts or node.op not in _RULES:
            forms[node.index] = None
        else:
            forms[node.index] = _RULES[node.op](*parts)
    return [forms[root.index] for root in roots]


def _without(node: Node, args: Sequence[Node]) -> Node:
    """The node with arguments in which a symbol has cancelled: x - x, 0 x."""
    same = all(a.index == b.index for a, b in zip(node.args, args, strict=True))
    return node if same else node.graph.make(node.op, *args)


def _number(node: Node, value: float) -> Node:
    return node.graph.constant(value)


def _each(function: Callable[..., Node], *forms: Form) -> Form:
    """The same linear operation on the offsets and on the slopes of each symbol."""
    keys = dict.fromkeys(k for form in forms for k in form.slopes)
    zero = _number(forms[0].offset, 0.0)
    slopes = {k: function(*(form.slopes.get(k, zero) for form in forms)) for k in keys}
    kept = {k: slope for k, slope in slopes.items() if not slope.is_constant(0.0)}
    return Form(kept, function(*(form.offset for form in forms)))


def _product(a: Form, b: Form) -> Form | None:
    if a.slopes and b.slopes:
        return None
    fixed, free = (b, a) if a.slopes else (a, b)
    return _each(lambda part: part * fixed.offset, free)


def _quotient(a: Form, b: Form) -> Form | None:
    return None if b.slopes else _each(lambda part: part / b.offset, a)


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
    "divide": _quotient,
    "where": _choice,
}


def solve(
    symbols: Sequence[Node], forms: Sequence[Form], usable: Callable[[Node], bool]
) -> list[Node] | None:
    """The values of the symbols for which each is equal to its form; None if there is no one.

    Elimination: a symbol that does not occur in its own form is replaced without a division.
    ``usable`` says of a divisor whether it differs from zero.
    """
    left = {s.index: form for s, form in zip(symbols, forms, strict=True)}
    done: list[tuple[int, Form]] = []
    while left:
        k = _next(left, usable)
        if k is None:
            return None
        form = left.pop(k)
        own = form.slopes.get(k)
        if own is not None:
            others = Form({j: s for j, s in form.slopes.items() if j != k}, form.offset)
            divisor = 1.0 - own
            form = _each(lambda part, divisor=divisor: part / divisor, others)
        left = {j: _replaced(other, k, form) for j, other in left.items()}
        done.append((k, form))
    values: dict[int, Node] = {}
    for k, form in reversed(done):
        terms = (slope * values[j] for j, slope in form.slopes.items())
        values[k] = form.offset.graph.total([form.offset, *terms])
    return [values[s.index] for s in symbols]


def _next(left: dict[int, Form], usable: Callable[[Node], bool]) -> int | None:
    """The symbol to replace next: one that needs no division, with the fewest others in it."""
    order = sorted(left, key=lambda k: (k in left[k].slopes, len(left[k].slopes)))
    for k in order:
        own = left[k].slopes.get(k)
        if own is None or usable(1.0 - own):
            return k
    return None


def _replaced(form: Form, k: int, by: Form) -> Form:
    slope = form.slopes.get(k)
    if slope is None:
        return form
    rest = Form({j: s for j, s in form.slopes.items() if j != k}, form.offset)
    return _each(lambda a, b: a + slope * b, rest, by)
