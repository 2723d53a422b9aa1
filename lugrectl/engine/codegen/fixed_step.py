"""Friction that changes its direction within a fixed step: where it does, and where it holds.

A rate that contains sign(x) of its own state x jumps where x passes zero. Each step is taken with
one direction, +1 or -1, and ends where x reaches zero. There the rates of x on both sides decide:
if that above zero is positive, x moves up; if that below is negative, it moves down; else x is held
at zero (Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, chapter 2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..expression.graph import Node, reachable, rename, substitute, symbols_in
from ..expression.numpy_protocol import COMPARISONS, LIBRARY, OPS
from ..tracing.tracer import Program
from .events import average_jumps
from .python_source import Emitter, indent
from .rosenbrock import Equations, step

ZERO = 1e-8  # of a state's scale: within this it has reached zero
HELD = 100.0  # weight of a motion missed by holding a state too long: it is not corrected later
AGAIN = 0.1  # part of a step to try if it starts at zero and ends on the other side
SHORTEST = 1e-3  # of the shortest step for accuracy: the shortest one to a zero


@dataclass(frozen=True, eq=False)
class Relay:
    """The state ``place`` whose rate contains its sign.

    ``up`` and ``down`` are its rates just above and just below zero, ``side`` is its direction in
    a step, 1.0 or -1.0, 0.0 while it is held. The rates may change while it is held (``turning``)
    if they depend on time or on other states.
    """

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
    places, signs = [], dict[int, Node]()
    for i, x in enumerate(program.x):
        jumps = {node.index: of for node, of in _jumps(x)}
        if any(node.index in jumps for node in reachable([rates[i]])):
            places.append(i)
            side = graph.symbol(f"side{i}")
            signs |= {index: of(side) for index, of in jumps.items()}
    rates = substitute(rates, lambda node, args: signs.get(node.index))
    every = [_relay(program, rates, i, places) for i in places]
    for i in places:
        rates[i] = abs(graph.symbol(f"side{i}")) * rates[i]
    return rates, every


def _jumps(x: Node) -> list[tuple[Node, Callable[[Node], Node]]]:
    """What jumps where x passes zero, and how it follows from the sign of x."""
    make = x.graph.make
    made = [(_sign(x), lambda side: side)]
    for op in sorted(COMPARISONS):
        made.append((make(op, x, 0.0), lambda side, op=op: make(op, side, 0.0)))
        made.append((make(op, 0.0, x), lambda side, op=op: make(op, 0.0, side)))
    return made


def _relay(program: Program, rates: Sequence[Node], place: int, places: Sequence[int]) -> Relay:
    graph, x = program.graph, program.x
    others = {graph.symbol(f"side{j}").index: _sign(x[j]) for j in places if j != place}
    others[x[place].index] = graph.constant(0.0)
    own = graph.symbol(f"side{place}").index
    sides = [others | {own: graph.constant(way)} for way in (1.0, -1.0)]
    up, down = (rename([rates[place]], to)[0] for to in sides)
    still = {node.value for node in (*program.u, *program.p)}
    still |= {node.value for node, rate in zip(x, program.xdot, strict=True) if rate is x[place]}
    held = where(up > 0.0, 1.0, where(down < 0.0, -1.0, 0.0))
    side = where(x[place] > 0.0, 1.0, where(x[place] < 0.0, -1.0, held))
    return Relay(place, up, down, side, not symbols_in([up, down]) <= still)


def _sign(x: Node) -> Node:
    return x.graph.make("sign", x)


def where(condition: Node, yes: Any, no: Any) -> Node:
    return condition.graph.make("where", condition, yes, no)


def larger(a: Node, b: Any) -> Node:
    return a.graph.make("maximum", a, b)


def smaller(a: Node, b: Any) -> Node:
    return a.graph.make("minimum", a, b)


def trial(program: Program) -> dict[str, Node]:
    """What a trial step of length h makes of the time t, of what is ``left`` of a substep, of h,
    of the ``shortest`` step, of the number ``spent`` and of the states, by their names.

    ``s0``, ... are the largest values of the states. A diverging run must not take minutes: each
    rejected shortest step makes the shortest step longer (TIRED), and after too many steps
    (``most``) each step tries to finish its substep.
    """
    graph, rates, every = program.graph, *relays(program)
    t, left, h, shortest, spent, rtol = map(graph.symbol, "t left h shortest spent rtol".split())
    new, errors = step(Equations(graph, program.t, program.x, program.u, rates))
    scales = [graph.symbol(f"s{i}") for i in range(len(new))]
    error = graph.total(
        abs(e) / larger(scale, abs(n)) for e, scale, n in zip(errors, scales, new, strict=True)
    )
    error = error + graph.total(_slip(program, r, new, scales[r.place]) for r in every)
    error = where(abs(graph.total(program.x)) < np.inf, error, 0.0)
    good = where(graph.make("logical_or", error <= rtol, h <= shortest), 1.0, 0.0)
    back, share, landed = graph.constant(0.0), graph.constant(1.0), graph.constant(0.0)
    for relay in every:
        over, lands = _at_zero(program, relay, new[relay.place], scales[relay.place])
        share, landed = smaller(share, over), larger(landed, lands)
        new[relay.place] = where(lands > 0.0, 0.0, new[relay.place])
    if every:
        back = where(share < 1.0, where(h > SHORTEST * shortest, good, 0.0), 0.0)
        good = good - back
    growth = 0.8 * np.sqrt(np.sqrt(rtol / larger(error, 1e-30)))  # pyright: ignore
    growth = where(np.equal(growth, growth), smaller(larger(growth, 0.1), 5.0), 0.1)  # pyright: ignore
    rest = where(good > 0.0, left - h, left)
    whole = graph.make("logical_or", spent + 1.0 > graph.symbol("most"), landed > 0.0)
    longer = smaller(rest, h * where(back > 0.0, share, growth))
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
    near = ZERO * larger(scale, before)
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
    pull = graph.symbol("h") * larger(larger(up, -down), 0.0)
    missed = HELD * where(abs(side) > 0.0, 0.0, pull)
    return missed / larger(scale, side * program.x[relay.place])


_LOOP = """
@fast
def run(x_start, start, length, u, series, p, y, gain, correct, dull, half, t0, dt, substeps, rtol,
        floor, y_hat, x_end, first, last):
    for lane in (slice(first, last),):
{unpack}
        own, begins, zero = series[lane], start[lane], t0[lane]
        whole = dt / substeps
{fixed}
        for j in range(length):
            k = begins + j
            t = zero + k * dt
{read}
{output}
            if correct:
{correct}
{scale}
            for i in range(substeps):
                t = zero + (k + i / substeps) * dt
                left = np.full(last - first, whole)
                h = left
                while np.any(left > 0.0):
{step}
                    {names}, = {codes},
{finish}
"""

TIRED = 1.005
MOST = 200  # to a substep, on average


def array_code(program: Program) -> str:
    """The function ``run`` for NumPy: all lanes at once."""
    fixed = [node.value for node in program.p]
    at_sample, at_step = Emitter("array", "a", fixed), Emitter("array", "b", fixed)
    outputs = at_sample.write(program.y)
    states, made = [node.value for node in program.x], trial(program)
    codes = at_step.write(list(made.values()))
    store = [f"y_hat[lane, j, {i}] = {code}" for i, code in enumerate(outputs)]
    scale = [f"s{i} = {_most('array', f's{i}', x)}" for i, x in enumerate(states)]
    return _LOOP.format(
        unpack=indent(unpack(program, "array"), 2),
        fixed=indent(at_sample.head + at_step.head, 2),
        read=indent([f"u{i} = u[own, k, {i}]" for i in range(len(program.u))], 3),
        output=indent(at_sample.body + store, 3),
        correct=indent(correction(outputs, states, "array"), 4),
        scale=indent(scale, 3),
        step=indent(at_step.body, 5),
        names=", ".join(made),
        codes=", ".join(codes),
        finish=indent([f"x_end[lane, {i}] = {x}" for i, x in enumerate(states)], 2),
    )


def unpack(program: Program, kind: str) -> list[str]:
    """States, their scales and parameters of a lane, its shortest step and largest step count."""
    lines = ["shortest = dt / substeps * 1e-4", "spent = 0.0", f"most = {MOST} * length * substeps"]
    lines += [f"{x.value} = x_start[lane, {i}]" for i, x in enumerate(program.x)]
    lines += [
        f"s{i} = {_most(kind, f'floor[{i}]', x.value)} + 1e-9" for i, x in enumerate(program.x)
    ]
    return lines + [f"{p.value} = p[lane, {i}]" for i, p in enumerate(program.p)]


def _most(kind: str, a: str, b: str) -> str:
    return f"{'np.maximum' if kind == 'array' else 'max'}({a}, abs({b}))"


def correction(outputs: Sequence[str], states: Sequence[str], kind: str) -> list[str]:
    """x += gain e, e = y - y_hat; of e within ``half`` the part ``dull`` is dropped."""
    drop, clip = "0.0 if c{0} != c{0} else c{0}", "max(-half[{0}], min(half[{0}], c{0}))"
    if kind == "array":
        drop, clip = "np.where(np.isnan(c{0}), 0.0, c{0})", "np.clip(c{0}, -half[{0}], half[{0}])"
    lines = []
    for o, code in enumerate(outputs):
        lines += [f"c{o} = y[k, {o}] - {code}", f"c{o} = " + drop.format(o)]
        less = f"c{o} = c{o} - dull[k, {o}] * {clip.format(o)}"
        lines += ["if len(dull) > 0:", f"    {less}"]
    for i, name in enumerate(states):
        gains = " + ".join(f"gain[lane, {i}, {o}] * c{o}" for o in range(len(outputs)))
        lines += [f"{name} = {name} + {gains}"] if gains else []
    return lines


PLAIN = {"abs", "sqrt", "tanh"}  # available in processors, or written by other functions

# each place takes the next lane as soon as its own is done; none waits for another
_WIDE_LOOP = """
import numpy as np


@fast
def run(x_start, start, length, u, series, p, y, gain, correct, dull, half, t0, dt, substeps, rtol,
        floor, y_hat, x_end, first, last):
    whole = dt / substeps
    lane_at, sample_at = np.zeros({width}, np.int64), np.zeros({width}, np.int64)
    turn_at = np.zeros({width}, np.int64)
{rooms}
    for l in range({width}):
        lane = first
{unpack}
{keep}
        lane_at[l], sample_at[l] = -1, length
    following = first
    unfinished = 1.0
    while unfinished > 0.0:
        unfinished = 0.0
        for l in range({width}):
            if left_at[l] <= 0.0:
                lane, j, i = lane_at[l], sample_at[l], turn_at[l] + 1
                if i >= substeps:
                    j, i = j + 1, 0
                if j >= length:
                    if lane >= 0:
{finish}
                    lane = -1
                    if following < last:
                        lane, j, i = following, 0, 0
                        following = following + 1
{take}
                lane_at[l], sample_at[l], turn_at[l] = lane, j, i
                if lane >= 0:
                    own, k = series[lane], start[lane] + j
                    t = t0[lane] + (k + i / substeps) * dt
{read}
{keep_read}
                    if i == 0:
{load}
{output}
                        if correct:
{correct}
{scale}
{keep_moving}
                    t_at[l], left_at[l], h_at[l] = t, whole, whole
            unfinished = unfinished + left_at[l]
        for l in range({width}):
{load_step}
{step}
"""


def is_wide(program: Program) -> bool:
    """Whether each operation of a program's step is available for several numbers at once."""
    nodes = reachable(trial(program).values())
    calls = {OPS[n.op].scalar.partition("(")[0] for n in nodes if n.args}
    return {call for call in calls if call.isidentifier()} <= {*LIBRARY, *PLAIN}


def lane_code(program: Program, kind: str, width: int) -> str:
    """The function ``run``, which works through the lanes by blocks; ``kind`` "wide" can be
    vectorised, "scalar" has all functions."""
    fixed = [node.value for node in program.p]
    at_sample, at_step = Emitter(kind, "a", fixed), Emitter(kind, "b", fixed)
    outputs = at_sample.write(program.y)
    states, inputs = ([node.value for node in of] for of in (program.x, program.u))
    made = trial(program)
    pairs = zip(made, at_step.write(list(made.values())), strict=True)
    # a place without a lane makes steps of zero length, which change nothing
    inner = [*at_step.body, *(f"{name}_at[l] = {code}" for name, code in pairs)]
    scales = [f"s{i}" for i in range(len(states))]
    known = [
        *fixed,
        "shortest",
        "spent",
        *(line.split(" = ")[0] for line in at_sample.head + at_step.head),
    ]
    moving = [*states, *scales]
    rooms = [*known, *moving, *inputs, "t", "left", "h"]
    read = [f"{name} = u[own, k, {i}]" for i, name in enumerate(inputs)]
    store = [f"y_hat[lane, j, {i}] = {code}" for i, code in enumerate(outputs)]
    taken = [*unpack(program, "scalar"), *at_sample.head, *at_step.head]
    return _WIDE_LOOP.format(
        width=width,
        rooms=indent([f"{name}_at = np.zeros({width})" for name in rooms], 1),
        unpack=indent(taken, 2),
        keep=indent(_kept([*known, *moving]), 2),
        take=indent([*taken, *_kept([*known, *moving])], 6),
        finish=indent([f"x_end[lane, {i}] = {x}_at[l]" for i, x in enumerate(states)], 6),
        read=indent(read, 5),
        keep_read=indent(_kept(inputs), 5),
        load=indent(_loaded([*known, *moving]), 6),
        output=indent([*at_sample.body, *store], 6),
        correct=indent(correction(outputs, states, "scalar"), 7),
        scale=indent([f"s{i} = max(s{i}, abs({x}))" for i, x in enumerate(states)], 6),
        keep_moving=indent(_kept(moving), 6),
        load_step=indent(_loaded(rooms), 3),
        step=indent(inner, 3),
    )


def _kept(names: Iterable[str]) -> list[str]:
    return [f"{name}_at[l] = {name}" for name in names]


def _loaded(names: Iterable[str]) -> list[str]:
    return [f"{name} = {name}_at[l]" for name in names]
