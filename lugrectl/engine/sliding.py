"""Relays at rest: where both sides of a jump drive its switching function to zero, it stays there.

The equations of such a rest are those of Filippov, Differential Equations with Discontinuous
Righthand Sides (1988), chapter 2: the mean of the rates on the two sides, weighted so that the
switching function does not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .derivative import derivatives
from .graph import Node, rename, symbols_in
from .program import Program


@dataclass(frozen=True, eq=False)
class Sliding:
    """The rates with rests in them.

    The symbol ``on0`` is 1 while the jump with the switching function 0 rests, else 0.
    ``sides`` are the rates of that function above and below its zero, ``moves`` how far each
    state goes with it along the jump; of the jumps that can come to rest only.
    """

    xdot: list[Node]
    sides: dict[int, tuple[Node, Node]]
    moves: dict[int, dict[int, Node]]


def sliding(
    program: Program, smooth: Sequence[Node], leads: Sequence[Node], jumps: Sequence[bool]
) -> Sliding:
    """Rests for the smooth rates and switching functions of ``freeze_modes``.

    Expressions after the rates of the states, outputs say, are taken along.
    Several rests at a time are eliminated one after the other, as unknowns of a linear system.
    """
    graph, roots = program.graph, list(smooth)
    found: list[int] = []
    for i in (i for i, jump in enumerate(jumps) if jump):
        mode, on = graph.symbol(f"m{i}"), graph.symbol(f"on{i}")
        above, below = (rename(roots, {mode.index: graph.constant(v)}) for v in (1.0, -1.0))
        up, down = (_rate(program, leads[i], side) for side in (above, below))
        if _at_zero(up - down, leads[i]).is_constant(0.0):
            continue
        found.append(i)
        share = (up + down) / graph.make("where", on > 0.0, down - up, 1.0)
        roots = [
            old if a is b else graph.make("where", on > 0.0, 0.5 * (a + b + share * (a - b)), old)
            for old, a, b in zip(roots, above, below, strict=True)
        ]
    sides, moves = {}, {}
    for i in found:
        above, below = (_free(roots, i, value) for value in (1.0, -1.0))
        up, down = (_rate(program, leads[i], side) for side in (above, below))
        sides[i] = up, down
        pairs = list(zip(above, below, strict=True))[: len(program.x)]
        apart = ((j, a - b) for j, (a, b) in enumerate(pairs))
        moves[i] = {j: jump / (up - down) for j, jump in apart if not jump.is_constant(0.0)}
    return Sliding(roots, sides, moves)


def _free(roots: Sequence[Node], i: int, value: float) -> list[Node]:
    """The rates on one side of jump i, which does not rest; others may."""
    graph = roots[0].graph
    mode, on = graph.symbol(f"m{i}"), graph.symbol(f"on{i}")
    return rename(roots, {mode.index: graph.constant(value), on.index: graph.constant(0.0)})


def _rate(program: Program, lead: Node, xdot: Sequence[Node]) -> Node:
    """Time derivative of a switching function."""
    graph = program.graph
    terms = [derivatives([lead], program.t)[0]]
    terms += [derivatives([lead], x)[0] * f for x, f in zip(program.x, xdot, strict=False)]
    slopes = (graph.symbol(f"du{i}") for i in range(len(program.u)))
    terms += [derivatives([lead], u)[0] * d for u, d in zip(program.u, slopes, strict=True)]
    return graph.total(terms)


def _at_zero(node: Node, lead: Node) -> Node:
    """A node where the switching function is 0, if that is easy to see: w = 0, or w = v.

    A jump of |w| sign(w), say, is none there.
    """
    sides = [lead, lead.graph.constant(0.0)] if lead.op != "subtract" else list(lead.args)
    for one, other in (sides, sides[::-1]):
        if one.op == "symbol" and one.value not in symbols_in([other]):
            return rename([node], {one.index: other})[0]
    return node


def names(made: Sliding, prefix: str = "") -> list[str]:
    """Variables for the rates of the switching functions on both sides."""
    return [f"{prefix}{side}{i}" for i in made.sides for side in ("up", "down")]


def settle(made: Sliding, states: Sequence[str], sides: Sequence[str]) -> list[str]:
    """Code at the start of a step: which jumps rest, from the rates that ``sides`` works out."""
    if not made.sides:
        return []
    lines = [f"for _ in range({2 * len(made.sides)}):", *("    " + line for line in sides)]
    lines += ["    changed = False"]
    for i in made.sides:
        lines += [
            f"    dead = DEAD * (abs(up{i}) + abs(down{i}))",
            f"    rests = up{i} < -dead and down{i} > dead",
            f"    if rests != (on{i} > 0.0) and (on{i} > 0.0 or abs(a{i}) <= DEAD * r{i}):",
            f"        m{i} = 0.0 if rests else (1.0 if up{i} >= -dead else -1.0)",
            f"        on{i}, changed, events = 1.0 - on{i}, True, events + 1",
        ]
    lines += ["    if not changed:", "        break"]
    for i, moves in made.moves.items():
        lines += [f"if on{i} > 0.0:"]
        lines += [f"    {states[j]} -= a{i} * move{j}_{i}" for j in moves] + [f"    a{i} = 0.0"]
    near = " or ".join(f"on{i} > 0.0 or abs(a{i}) <= DEAD * r{i}" for i in made.sides)
    return [f"if high == 0.0 and ({near}):", *("    " + line for line in lines)]


def margin(i: int, prefix: str = "") -> str:
    """Code of how far a rest is from its end, in widths of the dead band."""
    up, down = f"{prefix}up{i}", f"{prefix}down{i}"
    return f"min(-{up}, {down}) / (DEAD * (abs({up}) + abs({down})) + 1e-300)"
