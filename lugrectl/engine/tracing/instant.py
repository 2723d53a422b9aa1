"""Signals at one instant: outputs that depend on outputs, in the right order or solved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.sparse.csgraph import connected_components

from ...core.errors import InputError
from ..expression.affine import affine, solve
from ..expression.graph import Graph, Node, evaluate, reachable, rename
from . import piecewise

Rows = list[list[Node]]
TRIED = 0.7310585786300049  # in place of a symbol that is no parameter, where a divisor is tried
LEAST = 1e-12  # a divisor below this counts as zero


class Unsolved(Exception):
    """Outputs that depend on themselves in a way that cannot be solved; ``blocks`` are theirs."""

    def __init__(self, blocks: Sequence[int]) -> None:
        super().__init__("algebraic loop")
        self.blocks = list(blocks)


def loop_message(system: str, blocks: str) -> str:
    """The message on an algebraic loop through the blocks of these names."""
    return (
        f"{system}: algebraic loop through {blocks}; each output depends on itself at the same "
        "instant, and not by (piecewise) linear equations with one solution: put a state (a lag, "
        "a sensor) or a sample of delay between them."
    )


def settled(
    graph: Graph,
    counts: Sequence[int],
    respond: Callable[[Rows], Rows],
    values: Mapping[str, float],
) -> Rows:
    """The outputs of blocks that read each other's outputs at the same instant.

    Each single output is ordered after those that it depends on, so that a block may pass one
    channel at once and another through a state. Outputs that depend on themselves are solved
    where their equations are linear in them, or linear between clips: y = b/(1 - a) for
    y = a y + b.

    Parameters
    ----------
    counts : list of int
        Outputs of each block.
    respond : callable
        The outputs of all blocks, when theirs are the given ones: one row for each block.
    values : mapping
        Values of the parameters by symbol, to see that a divisor is not zero.

    Raises
    ------
    Unsolved
        For a loop that is not linear, or that has no or more than one solution.
    """
    places = [(i, j) for i, many in enumerate(counts) for j in range(many)]
    opened = [graph.symbol(f"o{len(graph.nodes)}") for _ in places]
    rows = respond(_rows(counts, opened))
    fresh = [rows[i][j] for i, j in places]
    number = {node.index: k for k, node in enumerate(opened)}
    reads = [[number[n.index] for n in reachable([f]) if n.index in number] for f in fresh]
    final: dict[int, Node] = {}
    for group in _ordered(reads):
        known = {opened[k].index: final[k] for k in {m for g in group for m in reads[g]} & {*final}}
        own = rename([fresh[k] for k in group], known)
        if len(group) > 1 or group[0] in reads[group[0]]:
            own = _solved([opened[k] for k in group], own, values)
            if own is None:
                raise Unsolved(sorted({places[k][0] for k in group}))
        final.update(zip(group, own, strict=True))
    return _rows(counts, [final[k] for k in range(len(places))])


def _rows(counts: Sequence[int], flat: Sequence[Node]) -> Rows:
    ends = np.cumsum([0, *counts])
    return [list(flat[a:b]) for a, b in zip(ends, ends[1:], strict=False)]


def _ordered(reads: Sequence[Sequence[int]]) -> list[list[int]]:
    """Groups of outputs that depend on each other, each group after those that it reads."""
    if not reads:
        return []
    reach = np.zeros((len(reads),) * 2)
    for k, row in enumerate(reads):
        reach[k, list(row)] = 1
    many, of = connected_components(reach, connection="strong")
    members = [np.flatnonzero(of == c).tolist() for c in range(many)]
    needs = [{int(of[m]) for k in group for m in reads[k]} - {c} for c, group in enumerate(members)]
    order: list[int] = []
    waiting = list(range(many))
    while waiting:
        ready = [c for c in waiting if needs[c] <= {*order}]
        order += ready
        waiting = [c for c in waiting if c not in ready]
    return [members[c] for c in order]


def _solved(
    symbols: Sequence[Node], roots: Sequence[Node], values: Mapping[str, float]
) -> list[Node] | None:
    forms = [form for form in affine(roots, symbols) if form is not None]
    if len(forms) < len(roots):
        return piecewise.solved(symbols, roots, values)
    return solve(symbols, forms, lambda divisor: _usable(divisor, values))


def _usable(divisor: Node, values: Mapping[str, float]) -> bool:
    """Whether a divisor differs from zero, with the parameters as they are."""
    names = {node.value for node in reachable([divisor]) if node.op == "symbol"}
    found = float(evaluate([divisor], {k: values.get(k, TRIED) for k in names})[0])
    return abs(found) > LEAST or not names <= {*values}


class AlgebraicLoop(InputError):
    """Outputs that depend on themselves without a state in between, and cannot be solved."""
