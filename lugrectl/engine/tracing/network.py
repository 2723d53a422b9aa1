"""Continuous and sampled blocks, connected by matrices of their signals, at one instant.

Outputs that depend on outputs are put in the right order, or solved. In a loop through clips each
minimum, maximum and absolute value follows one of its arguments. With every choice the equations
are linear; where all their determinants have one sign, exactly one solution agrees with its choice
(the determinant is linear in each choice, so it is nowhere zero between them).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from graphlib import TopologicalSorter
from itertools import product
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components

from ...core.errors import InputError
from ..expression.graph import (
    Graph,
    Node,
    affine,
    evaluate,
    reachable,
    rename,
    solve,
    substitute,
    symbols_in,
)

Rows = list[list[Node]]
TRIED = 0.7310585786300049  # in place of a symbol that is no parameter, where a divisor is tried
LEAST = 1e-12  # a divisor below this counts as zero
MOST = 6  # choices of a loop through clips; each doubles the equations


class AlgebraicLoop(InputError):
    """Outputs that depend on themselves without a state in between, and cannot be solved."""


class Unsolved(Exception):
    """Outputs that depend on themselves in a way that cannot be solved; ``blocks`` are theirs."""

    def __init__(self, blocks: Sequence[int]) -> None:
        super().__init__("algebraic loop")
        self.blocks = list(blocks)


def settled(
    graph: Graph,
    counts: Sequence[int],
    respond: Callable[[Rows], Rows],
    values: Mapping[str, float],
) -> Rows:
    """The outputs of blocks that read each other's outputs at the same instant.

    ``respond`` gives the outputs of all blocks, ``counts`` of each, when theirs are the given
    ones. Each single output is ordered after those that it depends on, so that a block may pass
    one channel at once and another through a state. Outputs that depend on themselves are solved
    where their equations are linear in them, or linear between clips: y = b/(1 - a) for
    y = a y + b. The ``values`` of the parameters show that a divisor is not zero.

    Raises Unsolved for a loop that is not linear, or that has no or more than one solution.
    """
    places = [(i, j) for i, count in enumerate(counts) for j in range(count)]
    opened = [graph.symbol(f"o{len(graph.nodes)}") for _ in places]
    rows = respond(by_block(counts, opened))
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
    return by_block(counts, [final[k] for k in range(len(places))])


def by_block(counts: Sequence[int], flat: Any) -> list[Any]:
    """Consecutive parts of a row, of so many each."""
    ends = np.cumsum([0, *counts]).tolist()
    return [flat[a:b] for a, b in zip(ends, ends[1:], strict=False)]


def _ordered(reads: Sequence[Sequence[int]]) -> list[list[int]]:
    """Groups of outputs that depend on each other, each group after those that it reads."""
    if not any(reads):
        return [[k] for k in range(len(reads))]
    reach = np.zeros((len(reads),) * 2)
    for k, row in enumerate(reads):
        reach[k, list(row)] = 1
    count, of = connected_components(reach, connection="strong")
    members = [np.flatnonzero(of == c).tolist() for c in range(count)]
    needs = [{int(of[m]) for k in group for m in reads[k]} - {c} for c, group in enumerate(members)]
    return [members[c] for c in TopologicalSorter(dict(enumerate(needs))).static_order()]


def _solved(
    symbols: Sequence[Node], roots: Sequence[Node], values: Mapping[str, float]
) -> list[Node] | None:
    """The values of the symbols for which each is its root; None if this is not known."""
    forms = [form for form in affine(roots, symbols) if form is not None]
    if len(forms) < len(roots):
        return _by_choices(symbols, roots, values)

    def usable(divisor: Node) -> bool:
        return abs(_value(divisor, values)) > LEAST or not symbols_in([divisor]) <= {*values}

    return solve(symbols, forms, usable)


def _value(divisor: Node, values: Mapping[str, float]) -> float:
    """The value of a divisor with the parameters as they are, by which it differs from zero."""
    known = {name: values.get(name, TRIED) for name in symbols_in([divisor])}
    return float(evaluate([divisor], known)[0])


def _by_choices(
    symbols: Sequence[Node], roots: Sequence[Node], values: Mapping[str, float]
) -> list[Node] | None:
    """The same of a loop through clips: of all choices the solution that agrees most with its."""
    inside, kinks = {s.index for s in symbols}, []
    for node in reachable(roots):
        if any(a.index in inside for a in node.args):
            inside.add(node.index)
            if node.op in ("minimum", "maximum", "absolute"):
                kinks.append(node.index)
    if not 0 < len(kinks) <= MOST:
        return None
    solution, best, signs = list[Node](), None, set[float]()
    for choice in product((0, 1), repeat=len(kinks)):
        chosen = _chosen(symbols, roots, dict(zip(kinks, choice, strict=True)), values)
        if chosen is None:
            return None
        own, agrees, sign = chosen
        signs.add(sign)
        if best is None:
            solution, best = own, agrees
            continue
        better, make = agrees > best, best.graph.make
        solution = [make("where", better, a, b) for a, b in zip(own, solution, strict=True)]
        best = make("maximum", best, agrees)
    return solution if len(signs) == 1 else None


def _chosen(
    symbols: Sequence[Node],
    roots: Sequence[Node],
    choice: Mapping[int, int],
    values: Mapping[str, float],
) -> tuple[list[Node], Node, float] | None:
    """The solution with one choice, by how much it agrees with that, and the determinant's sign."""
    margins, divisors = list[Node](), list[float]()

    def follow(node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.index not in choice:
            return None
        first = args[0]
        second = -first if node.op == "absolute" else args[1]
        more = second - first if node.op == "minimum" else first - second
        margins.append(-more if choice[node.index] else more)
        return second if choice[node.index] else first

    def usable(divisor: Node) -> bool:
        if not symbols_in([divisor]) <= {*values}:
            return False
        divisors.append(_value(divisor, values))
        return abs(divisors[-1]) > LEAST

    forms = [form for form in affine(substitute(roots, follow), symbols) if form is not None]
    own = solve(symbols, forms, usable) if len(forms) == len(roots) else None
    if own is None:
        return None
    agrees = rename(margins, {s.index: node for s, node in zip(symbols, own, strict=True)})
    least = reduce(lambda a, b: a.graph.make("minimum", a, b), agrees)
    return own, least, float(np.sign(np.prod(divisors)))


def is_wired(system: Any) -> bool:
    """Whether a system is an interconnection."""
    return hasattr(system, "syslist")


@dataclass(frozen=True, eq=False)
class Wires:
    """Blocks whose inputs are v = connect y + entry u, from their outputs y and from outside."""

    name: str
    blocks: Sequence[Any]
    connect: np.ndarray
    entry: np.ndarray

    @classmethod
    def inside(cls, system: Any) -> Wires:
        """Return the wires of an interconnection."""
        maps = [np.asarray(m, dtype=float) for m in (system.connect_map, system.input_map)]
        return cls(system.name, system.syslist, *map(np.atleast_2d, maps))

    def split(self, kind: str, flat: Any) -> list[Any]:
        """Return the part of each block in a row of all "inputs", "outputs" or "states"."""
        return by_block([int(getattr(b, f"n{kind}") or 0) for b in self.blocks], flat)

    def loop(self, members: Sequence[int]) -> AlgebraicLoop:
        """Return the error on an algebraic loop through these blocks."""
        names = ", ".join(self.blocks[i].name for i in members)
        return AlgebraicLoop(
            f"{self.name}: algebraic loop through {names}; each output depends on itself at the "
            "same instant, and not by (piecewise) linear equations with one solution: put a state "
            "(a lag, a sensor) or a sample of delay between them."
        )


@dataclass(frozen=True, eq=False)
class Part:
    """A block, its signals in the net, and the number of its sample time, None for none."""

    block: Any
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    group: int | None = None

    @classmethod
    def of(cls, block: Any, group: int | None = None) -> Part:
        """Return a block with its own names for its signals."""
        return cls(block, tuple(block.input_labels), tuple(block.output_labels), group)

    @property
    def sampled(self) -> bool:
        return self.group is not None

    @property
    def nstates(self) -> int:
        return int(self.block.nstates or 0)


@dataclass(frozen=True, eq=False)
class Net:
    """Parts, whose outputs of the same name are added, and the external signals.

    ``earlier``: at an update the sampled parts read the values of the others just before it, like
    a converter that measures before it sets its output; otherwise all values are simultaneous.
    ``alone``: the net of one system, whose names it has.
    """

    name: str
    parts: tuple[Part, ...]
    outside: tuple[str, ...]
    groups: int
    earlier: bool = False
    alone: bool = False

    @classmethod
    def of(cls, system: Any, *, sampled: bool = True) -> Net:
        """Return the net of one system; without ``sampled`` a discrete one acts at any instant."""
        part = Part.of(system, 0 if sampled and system.isdtime(strict=True) else None)
        return cls(system.name, (part,), part.inputs, int(part.sampled), alone=True)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """All output names, each once."""
        if self.alone:
            return self.parts[0].outputs
        return tuple(dict.fromkeys(self._made))

    @cached_property
    def _made(self) -> list[str]:
        return [label for part in self.parts for label in part.outputs]

    def makers(self, label: str) -> str:
        """The names of the blocks that put out a signal."""
        return ", ".join(
            dict.fromkeys(part.block.name for part in self.parts if label in part.outputs)
        )

    @cached_property
    def wires(self) -> Wires:
        """The connections by name; what comes from outside comes from there alone."""
        read = [label for part in self.parts for label in part.inputs]
        entry = _equal(read, self.outside)
        connect = _equal(read, self._made) * (entry.sum(axis=1, keepdims=True) == 0.0)
        return Wires(self.name, [part.block for part in self.parts], connect, entry)

    @cached_property
    def gather(self) -> np.ndarray:
        """The signals as sums of all outputs."""
        return _equal(self.signals, self._made)

    @cached_property
    def held(self) -> list[tuple[int, int]]:
        """Part and output of each value that is held between updates."""
        sampled = [(i, part) for i, part in enumerate(self.parts) if part.sampled]
        return [(i, j) for i, part in sampled for j in range(len(part.outputs))]

    @cached_property
    def places(self) -> list[slice]:
        """Each part's states among those of the continuous or those of the sampled parts."""
        ends, slices = {True: 0, False: 0}, []
        for part in self.parts:
            begin = ends[part.sampled]
            ends[part.sampled] = begin + part.nstates
            slices.append(slice(begin, begin + part.nstates))
        return slices

    def states(self, *, sampled: bool | None = None) -> tuple[str, ...]:
        """``block_state``, of the continuous parts, the sampled ones, or all in their order."""
        own = [p for p in self.parts if p.nstates and sampled in (None, p.sampled)]
        return tuple(
            label if self.alone else f"{part.block.name}_{label}"
            for part in own
            for label in part.block.state_labels
        )

    @property
    def looped(self) -> bool:
        """Whether there are several blocks, which may feed each other back."""
        return len(self.parts) > 1 or any(is_wired(part.block) for part in self.parts)

    @property
    def wiring(self) -> tuple[Any, ...]:
        """All but the blocks themselves."""
        parts = tuple((part.inputs, part.outputs, part.group) for part in self.parts)
        return parts, self.outside, self.groups, self.earlier, self.alone, self.name

    def count(self, sampled: bool) -> int:
        """The number of states of the continuous or the sampled parts."""
        return sum(part.nstates for part in self.parts if part.sampled is sampled)


def _equal(rows: Sequence[str], columns: Sequence[str]) -> np.ndarray:
    """1 where two names are the same."""
    places: dict[str, list[int]] = {}
    for k, label in enumerate(columns):
        places.setdefault(label, []).append(k)
    matrix = np.zeros((len(rows), len(columns)))
    for row, label in zip(matrix, rows, strict=True):
        row[places.get(label, [])] = 1.0
    return matrix
