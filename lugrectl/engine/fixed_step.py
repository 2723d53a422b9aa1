"""Friction that changes its direction within a fixed step: where it does, and where it holds.

A rate that contains sign(x) of its own state x jumps where x passes zero. Each step is taken with
one direction, +1 or -1, and ends where x reaches zero. There the rates of x on both sides decide:
if that above zero is positive, x moves up; if that below is negative, it moves down; else x is held
at zero (Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, chapter 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .graph import (
    COMPARISONS,
    LIBRARY,
    OPS,
    Node,
    reachable,
    rename,
    substitute,
    symbols_in,
    where,
)
from .python_source import Section, numbered, written
from .rosenbrock import Equations, step
from .tracer import Program

ufunc: Any = np  # of nodes
ZERO = 1e-8  # of a state's scale: within this it has reached zero
HELD = 100.0  # weight of a motion missed by holding a state too long: it is not corrected later
AGAIN = 0.1  # part of a step to try if it starts at zero and ends on the other side
SHORTEST = 1e-3  # of the shortest step for accuracy: the shortest one to a zero


def average_jumps(roots: Sequence[Node], fixed: set[str]) -> list[Node]:
    """For a step of fixed length: np.where(t >= t0, a, b) becomes b + s (a - b), where s is the
    part of [t, t + h] after t0, so that the result is a continuous function of t0. The start of
    the step is the symbol ``begin``; ``fixed`` are the symbols beside t in a condition.
    """

    def rule(node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.op != "where" or node.args[0].op not in COMPARISONS:
            return None
        names, (low, high) = symbols_in([node.args[0]]), node.args[0].args
        if "t" not in names or not names <= fixed | {"t"}:
            return None
        return args[2] + _held_part(high - low) * (args[1] - args[2])

    return substitute(roots, rule)


def _held_part(lead: Node) -> Node:
    """The part of the step in which ``lead`` >= 0, if it is linear over the step."""
    begin, h, t = map(lead.graph.symbol, ("begin", "h", "t"))
    first, last = (rename([lead], {t.index: at})[0] for at in (begin, begin + h))
    part = (ufunc.maximum(last, 0.0) - ufunc.maximum(first, 0.0)) / (last - first)
    return where(abs(last - first) > 0.0, part, where(first >= 0.0, 1.0, 0.0))


@dataclass(frozen=True, eq=False)
class Relay:
    """The state ``place`` whose rate contains its sign: its rates ``up`` just above and ``down``
    just below zero, its direction ``side`` in a step, 0.0 while it is held, and whether its rates
    may change meanwhile (``turning``)."""

    place: int
    up: Node
    down: Node
    side: Node
    turning: bool


def relays(program: Program) -> tuple[list[Node], list[Relay]]:
    """Rates with the symbols ``side<place>``, and the relays; a condition on time counts by its
    share of the step."""
    graph = program.graph
    rates = average_jumps(program.xdot, {node.value for node in program.p})
    own = [any(_jumps(n, x) for n in reachable([r])) for x, r in zip(program.x, rates, strict=True)]
    places = [i for i, jumps in enumerate(own) if jumps]
    sides = {program.x[i].index: graph.symbol(f"side{i}") for i in places}

    def rule(node: Node, args: tuple[Node, ...]) -> Node | None:
        x = next((a for a in node.args if a.index in sides and _jumps(node, a)), None)
        if x is None:
            return None
        given = [sides[x.index] if a is x else a for a in node.args]
        return given[0] if node.op == "sign" else graph.make(node.op, *given)

    rates = substitute(rates, rule)
    every = [_relay(program, rates, i, places) for i in places]
    for i in places:
        rates[i] = abs(graph.symbol(f"side{i}")) * rates[i]
    return rates, every


def _jumps(node: Node, x: Node) -> bool:
    """Whether a node jumps where x passes zero."""
    compared = node.op in COMPARISONS and any(a.is_constant(0.0) for a in node.args)
    return (node.op == "sign" or compared) and any(a is x for a in node.args)


def _relay(program: Program, rates: Sequence[Node], place: int, places: Sequence[int]) -> Relay:
    graph, x = program.graph, program.x
    others = {graph.symbol(f"side{j}").index: ufunc.sign(x[j]) for j in places if j != place}
    others[x[place].index] = graph.constant(0.0)
    own = graph.symbol(f"side{place}").index
    sides = [others | {own: graph.constant(way)} for way in (1.0, -1.0)]
    up, down = (rename([rates[place]], to)[0] for to in sides)
    still = {node.value for node in (*program.u, *program.p)}
    still |= {node.value for node, rate in zip(x, program.xdot, strict=True) if rate is x[place]}
    held = where(up > 0.0, 1.0, where(down < 0.0, -1.0, 0.0))
    side = where(x[place] > 0.0, 1.0, where(x[place] < 0.0, -1.0, held))
    return Relay(place, up, down, side, not symbols_in([up, down]) <= still)


def trial(program: Program) -> dict[str, Node]:
    """What a trial step of length h makes of the time t, of what is ``left`` of a substep, of h,
    of the ``shortest`` step, of the number ``spent`` and of the states, by their names.

    A diverging run must not take minutes: each rejected shortest step makes the shortest step
    longer (TIRED), and after too many steps (``most``) each tries to finish its substep.
    """
    graph, rates, every = program.graph, *relays(program)
    t, left, h, shortest, spent, rtol = map(graph.symbol, "t left h shortest spent rtol".split())
    new, errors = step(Equations(graph, program.t, program.x, program.u, rates))
    scales = [graph.symbol(f"s{i}") for i in range(len(new))]
    error = graph.total(
        abs(e) / ufunc.maximum(s, abs(n)) for e, s, n in zip(errors, scales, new, strict=True)
    )
    error = error + graph.total(_slip(program, r, new, scales[r.place]) for r in every)
    error = where(abs(graph.total(program.x)) < np.inf, error, 0.0)
    good = where(graph.make("logical_or", error <= rtol, h <= shortest), 1.0, 0.0)
    back, share, landed = graph.constant(0.0), graph.constant(1.0), graph.constant(0.0)
    for relay in every:
        over, lands = _at_zero(program, relay, new[relay.place], scales[relay.place])
        share, landed = ufunc.minimum(share, over), ufunc.maximum(landed, lands)
        new[relay.place] = where(lands > 0.0, 0.0, new[relay.place])
    if every:
        back = where(share < 1.0, where(h > SHORTEST * shortest, good, 0.0), 0.0)
        good = good - back
    growth = 0.8 * ufunc.sqrt(ufunc.sqrt(rtol / ufunc.maximum(error, 1e-30)))
    growth = where(ufunc.equal(growth, growth), ufunc.minimum(ufunc.maximum(growth, 0.1), 5.0), 0.1)
    rest = where(good > 0.0, left - h, left)
    whole = graph.make("logical_or", spent + 1.0 > graph.symbol("most"), landed > 0.0)
    longer = ufunc.minimum(rest, h * where(back > 0.0, share, growth))
    made = {
        "t": where(good > 0.0, t + h, t),
        "left": rest,
        "h": where(where(whole, good, 0.0) > 0.0, rest, longer),
        "shortest": where(good > 0.0, shortest * where(error > rtol, TIRED, 1.0), shortest),
        "spent": spent + 1.0,
    }
    pairs = zip(program.x, new, strict=True)
    made |= {x.value: where(good > 0.0, after, x) for x, after in pairs}
    to = {graph.symbol(f"side{r.place}").index: r.side for r in every}
    values = rename(rename(list(made.values()), to), {graph.symbol("begin").index: t})
    return dict(zip(made, values, strict=True))


def _at_zero(program: Program, relay: Relay, new: Node, scale: Node) -> tuple[Node, Node]:
    """The part of a step that ends where a state reaches zero, and whether (1.0) it ends there."""
    graph, side = program.graph, program.graph.symbol(f"side{relay.place}")
    before, now = side * program.x[relay.place], side * new
    near = ZERO * ufunc.maximum(scale, before)
    jumps = (relay.down - relay.up) * graph.symbol("dt") > near
    part = where(before > near, before / (before - now), AGAIN)
    over = graph.make("logical_and", jumps, now < -near)
    lands = graph.make("logical_and", jumps, graph.make("logical_and", now <= near, now < before))
    return where(over, part, 1.0), where(lands, 1.0, 0.0)


def _slip(program: Program, relay: Relay, new: Sequence[Node], scale: Node) -> Node:
    """The motion relative to the scale that is missed by holding a state too long."""
    graph, side = program.graph, program.graph.symbol(f"side{relay.place}")
    if not relay.turning:
        return graph.constant(0.0)
    end = program.t + graph.symbol("h")
    later = {x.index: n for x, n in zip(program.x, new, strict=True)}
    later |= {program.t.index: end, graph.symbol("begin").index: end}
    up, down = rename([relay.up, relay.down], later)
    pull = graph.symbol("h") * ufunc.maximum(ufunc.maximum(up, -down), 0.0)
    missed = HELD * where(abs(side) > 0.0, 0.0, pull)
    return missed / ufunc.maximum(scale, side * program.x[relay.place])


# each place takes the next lane as soon as its own is done; none waits for another. A place without
# a lane makes steps of zero length with the numbers of the first, which change nothing. At each
# sample x += gain e, e = y - y_hat; of e within `half` the part `dull` is dropped.
_RUN = """
import numpy as np
{robust}

@fast
def run(x_start, start, length, u, series, p, y, gain, correct, dull, half, t0, dt, substeps, rtol,
        floor, first, last, y_hat, x_end):
    whole, most = dt / substeps, {most} * length * substeps
    lane_at = {counts}
    sample_at = {counts}
    turn_at = {counts}
    each room:
        {name}_at = {numbers}
    for l in range({width}):
        lane_at[l], sample_at[l] = -2, length
    following = first
    unfinished = 1.0
    while unfinished > 0.0:
        unfinished = 0.0
        for l in range({width}):
            if left_at[l] <= 0.0:
                lane, j, i = lane_at[l], sample_at[l], turn_at[l] + 1
                if i >= substeps:
                    j, i = j + 1, 0
                if j >= length and lane != -1:
                    if lane >= 0:
                        each state:
                            x_end[lane][{i}] = {name}_at[l]
                    lane, own = -1, first
                    if following < last:
                        lane, own, j, i = following, following, 0, 0
                        following = following + 1
                    shortest, spent = whole * 1e-4, 0.0
                    each state:
                        {name} = x_start[own][{i}]
                        s{i} = max(floor[{i}], abs({name})) + 1e-9
                    each parameter:
                        {name} = p[own][{i}]
                    code fixed
                    each held:
                        {name}_at[l] = {name}
                lane_at[l], sample_at[l], turn_at[l] = lane, j, i
                if lane >= 0:
                    own, k = series[lane], start[lane] + j
                    t = t0[lane] + (k + i / substeps) * dt
                    each input:
                        {name} = u[own][k][{i}]
                        {name}_at[l] = {name}
                    if i == 0:
                        each held:
                            {name} = {name}_at[l]
                        code outputs
                        if correct:
                            each output:
                                c{i} = y[k][{i}] - y_hat[lane][j][{i}]
                                c{i} = 0.0 if c{i} != c{i} else c{i}
                                if len(dull) > 0:
                                    near = max(-half[{i}], min(half[{i}], c{i}))
                                    c{i} = c{i} - dull[k][{i}] * near
                            each state:
                                {name} = {name} + {gains}
                        each state:
                            s{i} = max(s{i}, abs({name}))
                        each moving:
                            {name}_at[l] = {name}
                    t_at[l], left_at[l], h_at[l] = t, whole, whole
            unfinished = unfinished + left_at[l]
        for l in range({width}):
            each room:
                {name} = {name}_at[l]
            code step
"""
TIRED = 1.005
MOST = 200  # to a substep, on average


def lane_code(program: Program, kind: str, width: int) -> str:
    """The function ``run``, which works through the lanes by blocks of a width; ``kind`` "wide" can
    be vectorised, "compiled" has all functions, "python" is not compiled (errors are caught)."""
    guarded, of = kind == "python", "wide" if kind == "wide" else "scalar"
    every, made = [node.value for node in program.p], trial(program)
    fixed = [] if guarded else every
    states, inputs = ([node.value for node in of] for of in (program.x, program.u))
    count = range(len(program.y))
    gains = [" + ".join(f"gain[lane][{i}][{o}] * c{o}" for o in count) for i in range(len(states))]
    shown = [f"y_hat[lane][j][{o}]" for o in count]
    outputs = Section(shown, program.y, "a", fixed, kind=of)
    after = Section([f"{k}_at[l]" for k in made], list(made.values()), "b", fixed, kind=of)
    head = outputs.emitter.head + after.emitter.head
    moving = [*states, *(f"s{i}" for i in range(len(states)))]
    held = [*every, "shortest", "spent", *(line.split(" = ")[0] for line in head), *moving]
    groups = {
        "state": [row | {"gains": gains[row["i"]] or "0.0"} for row in numbered(states)],
        "parameter": numbered(every),
        "input": numbered(inputs),
        "output": numbered(count),
        "held": numbered(held),
        "moving": numbered(moving),
        "room": numbered([*held, *inputs, "t", "left", "h"]),
    }
    return written(
        _RUN,
        groups,
        {"fixed": head, "outputs": outputs.lines(guarded), "step": after.lines(guarded)},
        robust=outputs.robust() + after.robust() if guarded else "",
        most=MOST,
        width=width,
        counts=f"[0] * {width}" if guarded else f"np.zeros({width}, np.int64)",
        numbers=f"[0.0] * {width}" if guarded else f"np.zeros({width})",
    )


PLAIN = {"abs", "sqrt", "tanh"}  # available in processors, or written by other functions


def is_wide(program: Program) -> bool:
    """Whether each operation of a program's step is available for several numbers at once."""
    nodes = reachable(trial(program).values())
    calls = {OPS[n.op].partition("(")[0] for n in nodes if n.args}
    return {call for call in calls if call.isidentifier()} <= {*LIBRARY, *PLAIN}
