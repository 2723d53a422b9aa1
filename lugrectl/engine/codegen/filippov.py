"""Relays at rest: if both sides of a jump drive its switching function to zero, it stays there.

The equations of such a rest are those of Filippov, Differential Equations with Discontinuous
Righthand Sides (1988), chapter 2: the mean of the rates on the two sides, weighted so that the
switching function does not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..expression.derivative import derivatives
from ..expression.graph import Node, rename, symbols_in
from ..tracing.equations import Program
from .rosenbrock import SparseLU

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
    """Rests for the smooth rates and switching functions of ``freeze_modes``.

    Expressions after the rates of the states (outputs, for instance) are converted as well.
    Jumps that rest at the same time are added.
    """
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
    right = [make("where", on[i], _rate(program, leads[i], smooth), 0.0) for i in apart]
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


def _along(program: Program, lead: Node, motion: Sequence[Node]) -> Node:
    """The change of a switching function with the states."""
    pairs = zip(program.x, motion, strict=False)
    return program.graph.total(derivatives([lead], x)[0] * step for x, step in pairs)


def _rate(program: Program, lead: Node, xdot: Sequence[Node]) -> Node:
    """Time derivative of a switching function."""
    terms = [_along(program, lead, xdot), derivatives([lead], program.t)[0]]
    slopes = (program.graph.symbol(f"du{i}") for i in range(len(program.u)))
    terms += [derivatives([lead], u)[0] * d for u, d in zip(program.u, slopes, strict=True)]
    return program.graph.total(terms)


def _at_zero(gain: Node, lead: Node) -> bool:
    """Whether a jump vanishes where its switching function is 0 (w = 0, or w = v).

    It does for |w| sign(w), for instance.
    """
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
