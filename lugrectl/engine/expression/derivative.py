"""Exact derivatives of expressions, as expressions of the same graph."""

from __future__ import annotations

from collections.abc import Sequence

from .graph import Node, reachable
from .operations import CHOICES, OPS


def derivatives(roots: Sequence[Node], variable: Node) -> list[Node]:
    """d root / d variable for each root.

    d|x|/dx = sign(x), 0 at 0; sign and comparisons count as constants; np.where, np.maximum
    and np.minimum as the active branch.
    """
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
