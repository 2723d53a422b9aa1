"""Where a right-hand side switches: events of a step, and relays that come to rest.

If both sides of a jump drive its switching function to zero, it stays there. The equations of such
a rest are those of Filippov, Differential Equations with Discontinuous Righthand Sides (1988),
chapter 2: the mean of the rates on the two sides, weighted so that the switching function does not
change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..expression.graph import Node, derivatives, rename, substitute, symbols_in
from ..expression.numpy_protocol import COMPARISONS
from ..tracing.tracer import Program
from .rosenbrock import SparseLU


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
) -> tuple[list[Node], list[Node], list[bool], dict[int, Node]]:
    """For steps that end at each kink or jump: smooth roots and switching functions.

    Between two events each |a|, sign(a), comparison, maximum and minimum stays on one side. Its
    side is the symbol ``m0``, ``m1``, ... (+1, 0, -1, or nan), the sign of the switching function
    with the same number. Conditions on ``fixed`` symbols alone are not changed. The third result
    says which functions switch a jump rather than a kink, the last one the side of each node.
    """
    leads: list[Node] = []
    jumps: set[int] = set()
    known: dict[int, Node] = {}
    modes: dict[int, Node] = {}

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
        modes[node.index] = side(make_lead(*args), node.op not in _KINKS)
        return result(modes[node.index], *args)

    smooth = substitute(roots, rule)
    return smooth, leads, [lead.index in jumps for lead in leads], modes


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


MOST = 4  # number of jumps of a system that can come to rest; any further ones keep switching


@dataclass(frozen=True, eq=False)
class Sliding:
    """The rates, including rests.

    The symbol ``on3`` is 1 while the jump with the switching function 3 rests, else 0; its
    ``m3`` is then 1. For each jump that can come to rest: ``parts`` is the weight of its lower
    side, between 0 and 1 in a rest; ``steps`` is the rate of its switching function above its
    zero minus that below; ``moves`` is the change of each state along the jump per unit of the
    switching function.
    """

    rates: list[Node]
    parts: dict[int, Node]
    steps: dict[int, Node]
    moves: dict[int, dict[int, Node]]


def sliding(
    program: Program, smooth: Sequence[Node], leads: Sequence[Node], jumps: Sequence[bool]
) -> Sliding:
    """Rests for the smooth rates of ``freeze_modes``, and for outputs after them; jumps add up."""
    make, one = program.graph.make, program.graph.constant(1.0)
    apart: dict[int, list[Node]] = {}
    for i in (i for i, jump in enumerate(jumps) if jump):
        mode = program.graph.symbol(f"m{i}").index
        above, below = (rename(smooth, {mode: program.graph.constant(v)}) for v in (1.0, -1.0))
        steps = [a - b for a, b in zip(above, below, strict=True)]
        if len(apart) < MOST and not _at_zero(_along(program, leads[i], steps), leads[i]):
            apart[i] = steps
    on = {i: program.graph.symbol(f"on{i}") > 0.0 for i in apart}
    gains = {(i, j): _along(program, leads[i], apart[j]) for i in apart for j in apart}
    matrix = [
        [make("where", on[i], gains[i, j], one if i == j else 0.0) for j in apart] for i in apart
    ]
    right = []
    for i in apart:  # the time derivative of the switching function
        terms = [_along(program, leads[i], smooth), derivatives([leads[i]], program.t)[0]]
        for k, u in enumerate(program.u):
            terms.append(derivatives([leads[i]], u)[0] * program.graph.symbol(f"du{k}"))
        right.append(make("where", on[i], program.graph.total(terms), 0.0))
    parts = dict(zip(apart, SparseLU(program.graph, matrix).solve(right), strict=True))
    rates = list(smooth)
    for i, steps in apart.items():
        rates = [rate - parts[i] * step for rate, step in zip(rates, steps, strict=True)]
    moves = {
        i: {
            j: step / gains[i, i]
            for j, step in enumerate(steps[: len(program.x)])
            if not step.is_constant(0.0)
        }
        for i, steps in apart.items()
    }
    return Sliding(rates, parts, {i: gains[i, i] for i in apart}, moves)


def resting(
    roots: Sequence[Node], made: Sliding, modes: Mapping[int, Node]
) -> tuple[list[Node], list[int]]:
    """Outputs in which a jump that rests is the mean of its sides, and the jumps that they see.

    The side is the symbol ``way3``, 1 in a rest.
    """

    def rule(node: Node, args: tuple[Node, ...]) -> Node | None:
        mode, symbol = modes.get(node.index), node.graph.symbol
        for i in made.parts:
            if mode is not None and f"m{i}" in symbols_in([mode]):
                way = rename([mode], {symbol(f"m{i}").index: symbol(f"way{i}")})[0]
                return _SIDES[node.op][1](way, *args)
        return None

    y = substitute(roots, rule)
    seen = [i for i in made.parts if f"way{i}" in symbols_in(y)]
    for i in seen:
        graph = y[0].graph
        way, one = graph.symbol(f"way{i}").index, graph.constant(1.0)
        pairs = zip(rename(y, {way: one}), rename(y, {way: -one}), strict=True)
        part = graph.make("where", graph.symbol(f"on{i}") > 0.0, graph.symbol(f"part{i}"), 0.0)
        y = [row - part * (above - below) for row, (above, below) in zip(y, pairs, strict=True)]
    return y, seen


def _along(program: Program, lead: Node, motion: Sequence[Node]) -> Node:
    """The change of a switching function with the states."""
    pairs = zip(program.x, motion, strict=False)
    return program.graph.total(derivatives([lead], x)[0] * step for x, step in pairs)


def _at_zero(gain: Node, lead: Node) -> bool:
    """Whether a jump vanishes where its switching function is 0, as |w| sign(w) does at w = 0."""
    pair = [lead, lead.graph.constant(0.0)] if lead.op != "subtract" else list(lead.args)
    for one, other in (pair, pair[::-1]):
        if one.op == "symbol" and one.value not in symbols_in([other]):
            gain = rename([gain], {one.index: other})[0]
            break
    return gain.is_constant(0.0)


def names(made: Sliding, prefix: str = "") -> list[str]:
    """Variables for the weights and steps of all rests."""
    return [f"{prefix}{name}{i}" for name in ("part", "step") for i in made.parts]


def exactly_at_zero(made: Sliding, states: Sequence[str]) -> list[str]:
    """Code that removes from the states what keeps resting switching functions from zero."""
    lines = []
    for i, moves in made.moves.items():
        lines += [f"if on{i} > 0.0:"]
        lines += [f"    {states[j]} -= a{i} * move{j}_{i}" for j in moves] + [f"    a{i} = 0.0"]
    return lines


def settle(made: Sliding, states: Sequence[str], weights: Sequence[str]) -> list[str]:
    """Code at the start of a step that decides which jumps rest, by the code ``weights``.

    At first all jumps at zero rest. Of those whose weight is outside (0, 1), the farthest outside
    is released, and this is repeated until there is none.
    """
    if not made.parts:
        return []
    lines = []
    for i in made.parts:
        lines += [f"was{i}, side{i} = on{i}, m{i}", f"if abs(a{i}) <= DEAD * r{i}:"]
        lines += [f"    on{i}, m{i} = 1.0, 1.0"]
    lines += [f"for _ in range({len(made.parts) + 1}):", *("    " + line for line in weights)]
    lines += ["    farthest, leaving = 0.0, -1"]
    for i in made.parts:
        lines += [
            f"    if on{i} > 0.0 and not outside(part{i}, step{i}) <= farthest:",
            f"        farthest, leaving = outside(part{i}, step{i}), {i}",
        ]
    lines += ["    if leaving < 0:", "        break"]
    for i in made.parts:
        lines += [f"    if leaving == {i}:", f"        on{i} = 0.0"]
        lines += [f"        m{i} = (1.0 if part{i} < 0.5 else -1.0) if farthest < inf else side{i}"]
    lines += [f"events += on{i} != was{i}" for i in made.moves] + exactly_at_zero(made, states)
    near = " or ".join(f"on{i} > 0.0 or abs(a{i}) <= DEAD * r{i}" for i in made.parts)
    return [f"if high == 0.0 and ({near}):", *("    " + line for line in lines)]
