"""Loops through clips: outputs that depend on themselves by piecewise linear equations.

Each minimum, maximum and absolute value follows one of its arguments. With every choice the
equations are linear; where all their determinants have one sign, exactly one solution agrees with
its choice (the determinant is linear in each choice, so it is nowhere zero between them).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from ..expression.affine import affine, solve
from ..expression.graph import Node, evaluate, reachable, rename, substitute

MOST = 6  # choices; each doubles the equations
LEAST = 1e-12  # a determinant below this counts as zero


def solved(
    symbols: Sequence[Node], roots: Sequence[Node], values: Mapping[str, float]
) -> list[Node] | None:
    """The values of the symbols for which each is its root; None if this is not known."""
    kinks = _kinks(symbols, roots)
    if not 0 < len(kinks) <= MOST:
        return None
    found, best, signs = list[Node](), None, set[float]()
    for choice in product((0, 1), repeat=len(kinks)):
        made = _chosen(symbols, roots, dict(zip(kinks, choice, strict=True)), values)
        if made is None:
            return None
        own, agrees, sign = made
        signs.add(sign)
        if best is None:
            found, best = own, agrees
            continue
        better = agrees > best
        pairs = zip(own, found, strict=True)
        found = [a.graph.make("where", better, a, b) for a, b in pairs]
        best = best.graph.make("maximum", best, agrees)
    return found if len(signs) == 1 else None


def _kinks(symbols: Sequence[Node], roots: Sequence[Node]) -> list[int]:
    inside = {s.index for s in symbols}
    kinks = []
    for node in reachable(roots):
        if any(a.index in inside for a in node.args):
            inside.add(node.index)
            if node.op in ("minimum", "maximum", "absolute"):
                kinks.append(node.index)
    return kinks


def _chosen(
    symbols: Sequence[Node],
    roots: Sequence[Node],
    choice: Mapping[int, int],
    values: Mapping[str, float],
) -> tuple[list[Node], Node, float] | None:
    """The solution with one choice, by how much it agrees with that, and the determinant's sign."""
    margins = list[Node]()

    def follow(node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.index not in choice:
            return None
        first = args[0]
        second = -first if node.op == "absolute" else args[1]
        more = second - first if node.op == "minimum" else first - second
        margins.append(-more if choice[node.index] else more)
        return second if choice[node.index] else first

    forms = affine(substitute(roots, follow), symbols)
    if None in forms:
        return None
    divisors = list[float]()

    def usable(divisor: Node) -> bool:
        names = {n.value for n in reachable([divisor]) if n.op == "symbol"}
        if not names <= {*values}:
            return False
        divisors.append(float(evaluate([divisor], {k: values[k] for k in names})[0]))
        return abs(divisors[-1]) > LEAST

    own = solve(symbols, [form for form in forms if form is not None], usable)
    if own is None:
        return None
    known = {s.index: node for s, node in zip(symbols, own, strict=True)}
    agrees = rename(margins, known)
    least = agrees[0]
    for margin in agrees[1:]:
        least = least.graph.make("minimum", least, margin)
    return own, least, float(np.sign(np.prod(divisors)))
