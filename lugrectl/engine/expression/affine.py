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
        graph, parts = node.graph, [forms[a.index] for a in node.args]
        if node.index in own:
            forms[node.index] = Form({node.index: graph.constant(1.0)}, graph.constant(0.0))
        elif all(part is not None and not part.slopes for part in parts):
            # arguments may be new: in x - x and 0 x a symbol has cancelled
            args = [part.offset for part in parts if part]
            same = all(a.index == b.index for a, b in zip(node.args, args, strict=True))
            forms[node.index] = Form({}, node if same else graph.make(node.op, *args))
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


def solve(
    symbols: Sequence[Node], forms: Sequence[Form], usable: Callable[[Node], bool]
) -> list[Node] | None:
    """The values of the symbols for which each is equal to its form; None if there is no one.

    Elimination: a symbol that does not occur in its own form is replaced without a division.
    ``usable`` says of a divisor whether it differs from zero.
    """
    left = {s.index: form for s, form in zip(symbols, forms, strict=True)}
    done: list[tuple[int, Form]] = []

    def ready(k: int) -> bool:
        own = left[k].slopes.get(k)
        return own is None or usable(1.0 - own)

    while left:
        order = sorted(left, key=lambda k: (k in left[k].slopes, len(left[k].slopes)))
        k = next(filter(ready, order), None)
        if k is None:
            return None
        form = left.pop(k)
        own, others = form.slopes.get(k), _without(form, k)
        if own is not None:
            form = _each(lambda part, divisor=1.0 - own: part / divisor, others)
        for j, other in left.items():
            slope = other.slopes.get(k)
            if slope is not None:
                rest = _without(other, k)
                left[j] = _each(lambda a, b, slope=slope: a + slope * b, rest, form)
        done.append((k, form))
    values: dict[int, Node] = {}
    for k, form in reversed(done):
        terms = (slope * values[j] for j, slope in form.slopes.items())
        values[k] = form.offset.graph.total([form.offset, *terms])
    return [values[s.index] for s in symbols]


def _without(form: Form, k: int) -> Form:
    return Form({j: s for j, s in form.slopes.items() if j != k}, form.offset)
