"""Code of a run: updates of sampled blocks, and steps that end on the time grid and at switches.

If both sides of a jump drive its switching function to zero, it stays there. The equations of such
a rest are those of Filippov, Differential Equations with Discontinuous Righthand Sides (1988),
chapter 2: the mean of the rates on the two sides, weighted so that the switching function does not
change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .graph import Node, derivatives, rename, substitute, symbols_in, where
from .python_source import Section, numbered, reciprocals, summed, written
from .rosenbrock import Equations, SparseLU, step
from .tracer import Hybrid, Program


def freeze_modes(
    roots: Sequence[Node], fixed: set[str]
) -> tuple[list[Node], list[Node], list[bool], dict[int, Node]]:
    """For steps that end at each kink or jump: smooth roots, switching functions, which of them
    switch a jump rather than a kink, and the side of each node.

    The side of |a|, sign(a), a comparison, maximum or minimum in a step is the symbol ``m0``, ...
    (+1, 0, -1, or nan), the sign of the switching function with the same number.
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
    return where(mode > 0.0, yes, where(mode <= 0.0, no, yes + no))


def _floor(mode: Node, a: Node) -> Node:
    """The floor on its side, up to half a cell beyond: even for sin(pi a) > 0, else odd."""
    even = 2.0 * np.floor(0.5 * (a - 0.5) + 0.5)
    odd = 2.0 * np.floor(0.5 * (a - 1.5) + 0.5) + 1.0
    return where(mode > 0.0, even, where(mode < 0.0, odd, np.floor(a + 0.5)))


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
    """The rates, including rests: ``on3`` is 1 while the jump 3 rests, its ``m3`` then 1.

    For each jump that can rest: ``parts`` is the weight of its lower side, ``steps`` the rate of
    its switching function above its zero minus that below, ``moves`` the change of each state
    along the jump per unit of the switching function.
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


# l0, l1, ... are the switching functions after the trial step, a0, a1, ... before it, m0, m1,
# ... their sides during it: +1, -1, 0 for exactly 0, nan for NaN. A step must not pass a zero:
# the length at which it meets one is bracketed between `low` and `high` and found by regula
# falsi with the weights of Anderson and Bjorck (BIT 13, 1973), every fourth time by bisection. A
# switching function within DEAD times its largest value counts as zero; a step that starts there
# takes the side on which it ends. If it also ends there, the function does not limit the step.
# If many events follow each other without a step that ends FAR from all zeros, kinks are no
# longer located in the interval (noise about zero), and a jump that continues to switch (a relay
# that sticks) makes the remaining interval be stepped in short steps. A run that would never get
# through an interval is ended.
#
# At the start of a step all jumps at zero rest; of those whose weight is outside (0, 1), the
# farthest outside is released, until there is none.
#
# The error of a state counts relative to its size s: its value, or what it was a short time ago.
# s is the largest value until the state is below half of s; then s decreases by the factor e in
# twice the time w that the state took to fall from 0.9 s to 0.5 s. So s does not collapse where a
# state crosses zero, and a small motion after a large start is right. s is at least `floor` =
# atol / rtol, and SMALL of the largest value b so far, below which rounding would decide.
_RUN = """
DEAD = 1e-11
SMALL = 1e-7
FAR = 1e5
PATIENCE = 40
TRIALS = 65536


@small
def side(a):
    return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else a)


@small
def started(m, a, r):
    return m if abs(a) <= DEAD * r and a != 0.0 else side(a)


@small
def widest(r, a):  # not max, which Python and numba leave differently from nan
    return abs(a) if abs(a) > r else r


@small
def nearest(worst, far):
    return far if far < worst else worst


@small
def within(m, l):  # negative where a step ends on a side that it has not taken
    return m * l if m != 0.0 else -abs(l)


@small
def lands(m, l, a):
    return l == 0.0 and m != 0.0 and a != 0.0


@small
def distance(m, l, a, r):  # in widths of the dead band
    far = -2.0 if lands(m, l, a) else within(m, l) / (DEAD * r + 1e-300)
    return far if abs(far) > 1.0 or abs(a) > DEAD * r else 1e300


@small
def first_distance(m, a, r):  # of a function that has left the zero of an earlier event
    far = m * a / (DEAD * r + 1e-300)
    return far if far > 1.0 else 1e300


@small
def misled(m, l, a, r):
    return abs(a) <= DEAD * r and (within(m, l) < -DEAD * r or lands(m, l, a))


@small
def passed(m, l, r):
    return within(m, l) < -DEAD * r


@small
def turned(m, l, r):
    return side(l) if passed(m, l, r) or l == 0.0 or m * l != m * l else m


@small
def outside(part, step):  # how far the weight of a rest is from (0, 1)
    return DEAD + max(-part, part - 1.0) if step < 0.0 else inf


@small
def margin(part):
    return (0.5 - abs(part - 0.5)) / DEAD


{robust}
@fast
def run(
    grid, given, ticks, flags, held, p, rtol, floor, x_now, q_now, h_now, sizes, x_out, q_out,
    y_out, status
):
    each parameter:
        {name} = p[{i}]
    each state:
        {name}, states{i} = x_now[{i}], x_out[{i}]
        size{i} = max(abs({name}), floor, sizes[3 * {i}])
        inv{i} = 1.0 / size{i}
        top{i}, fell{i} = max(size{i}, sizes[3 * {i} + 1]), sizes[3 * {i} + 2]
    each own:
        {name}, own{i} = q_now[{i}], q_out[{i}]
    each kept:
        {name} = h_now[{i}]
    each free:
        in{i} = given[{i}]
    each row:
        row{i} = y_out[{i}]
    each lead:
        m{i}, r{i} = 0.0, 0.0
    each rest:
        on{i}, part{i} = 0.0, 0.0
    code fixed
    h_next, v_low, v_high, last, tries, steps = 0.0, 0.0, 0.0, 0, 0, 0
    for k in range(len(grid)):
        t, dt, done, low, high, events, relays = grid[k], 0.0, 0.0, 0.0, 0.0, 0, 0
        first_step, due = steps, 0.0
        each own:
            own{i}[k] = {name}
        each free:
            {name} = in{i}[k]
        each before:
            b{i} = {name}
        each ticked:
            if ticks[k]:
                each flag:
                    g{i} = flags[{i}][k]
                code updates
                if not isfinite({total}):
                    each own:
                        q_now[{i}] = {name}
                    each kept:
                        h_now[{i}] = {name}
                    status[1] = t
                    return 2
        each input:
            du{i} = 0.0
        if {moving} and k < len(grid) - 1:
            dt = grid[k + 1] - t
            each free:
                du{i} = 0.0 if held else (in{i}[k + 1] - in{i}[k]) / dt
        if k == 0:
            h_next = 0.01 * dt
        for again in range({nesting} if k == 0 or ticks[k] else 1):
            code leads
            each driven:
                on{i} = on{i} if abs(a{i}) <= DEAD * r{i} else 0.0
            each lead:
                if {free}:
                    m{i} = started(m{i}, a{i}, r{i})
        each lead:
            r{i} = widest(r{i}, a{i})
        fresh = True
        while fresh or done < dt:
            each resting:
                if high == 0.0 and ({near}):
                    each rest:
                        was{i}, side{i} = on{i}, m{i}
                        if abs(a{i}) <= DEAD * r{i}:
                            on{i}, m{i} = 1.0, 1.0
                    for _ in range({rests} + 1):
                        code weights
                        farthest, leaving = 0.0, -1
                        each rest:
                            if on{i} > 0.0 and not outside(part{i}, step{i}) <= farthest:
                                farthest, leaving = outside(part{i}, step{i}), {i}
                        if leaving < 0:
                            break
                        each rest:
                            if leaving == {i}:
                                on{i} = 0.0
                                new = 1.0 if part{i} < 0.5 else -1.0
                                m{i} = new if farthest < inf else side{i}
                    each rest:
                        events += on{i} != was{i}
                    code zeroed
            if fresh:
                fresh = False
                each shown:
                    way{i} = m{i} if a{i} == 0.0 else side(a{i})
                code outputs
                each state:
                    states{i}[k] = {name}
                if done >= dt:
                    break
            left = dt - done
            if high > 0.0:
                h = 0.5 * (low + high)
                if tries % 4 != 3:
                    h = low + (high - low) * (v_low / (v_low - v_high))
                tries += 1
            elif h_next > 0.999 * left:
                h = left
            elif h_next > 0.5 * left:
                h = 0.5 * left
            else:
                h = h_next
            if relays >= PATIENCE:
                h = min(h, left, 1e-3 * dt)
                status[3] = t
            code step
            steps += 1
            stuck = False
            if steps - first_step >= TRIALS:
                stuck, first_step, due = done <= due, steps, done + 1e-5 * dt
            each state:
                error{i} = e{i} * (inv{i} if abs(n{i}) <= size{i} else 1.0 / abs(n{i}))
            error = sqrt({error}) / rtol
            if stuck or not error <= 1.0 and not (relays >= PATIENCE and error < inf):
                h_next = h * max(0.1, 0.9 / sqrt(sqrt(error))) if error < inf else 0.1 * h
                low, high = 0.0, 0.0
                if stuck or h_next < 1e-13 * dt or t + h_next == t:
                    status[0], status[1], status[4] = k, t, steps
                    largest = -1.0
                    each state:
                        part = abs(error{i})
                        if largest == largest and not part <= largest:
                            status[2], largest = {i}, part
                    return 1
                continue
            each input:
                v{i} = {name} + h * du{i}
            code leads_after
            worst = 1e300
            each lead:
                r{i} = widest(r{i}, l{i})
                if {free}:
                    worst = nearest(worst, distance(m{i}, l{i}, a{i}, r{i}))
            each resting:
                if {sum_of_rests} > 0.0:
                    code weights_after
                    each rest:
                        if on{i} > 0.0:
                            worst = nearest(worst, margin(end_part{i}))
            crossed = worst < -1.0 and events < 2 * PATIENCE
            if crossed and low == 0.0 and high == 0.0:
                flipped = False
                each lead:
                    if {free}:
                        if misled(m{i}, l{i}, a{i}, r{i}):
                            m{i} = side(l{i})
                            events += 1
                            relays += {jump}
                            flipped = True
                if flipped:
                    continue
                first = 1e300
                each lead:
                    if {free}:
                        first = nearest(first, first_distance(m{i}, a{i}, r{i}))
                each rest:
                    if on{i} > 0.0:
                        first = nearest(first, margin(part{i}))
                v_low, tries, last = max(first, 1.0), 0, 0
            if crossed:
                if last == -1:
                    v_low *= 1.0 - worst / v_high if worst > v_high else 0.5
                high, v_high, last = h, worst, -1
            elif high > 0.0 and worst > 1.0:
                if last == 1:
                    v_high *= 1.0 - worst / v_low if worst < v_low else 0.5
                low, v_low, last = h, worst, 1
            if (crossed or low == h) and t + low < t + high and high - low > 1e-15 * dt:
                continue
            each lead:
                if {free}:
                    if passed(m{i}, l{i}, r{i}):
                        events += 1
                        relays += {jump}
                    m{i} = turned(m{i}, l{i}, r{i})
                a{i} = l{i}
            each state:
                {name} = n{i}
            code zeroed
            each state:
                z = abs({name})
                if z > size{i}:
                    size{i}, top{i}, fell{i} = z, max(top{i}, z), 0.0
                    inv{i} = 1.0 / size{i}
                elif z >= 0.5 * size{i}:
                    fell{i} = fell{i} + h if z < 0.9 * size{i} else 0.0
                else:
                    shrunk = size{i} * (fell{i} / (fell{i} + 0.5 * h))
                    size{i} = max(z, shrunk, SMALL * top{i}, floor)
                    inv{i} = 1.0 / size{i}
            each input:
                {name} = v{i}
            t, done = t + h, done + h
            if left - h <= 1e-13 * dt:
                done = dt
            if high > 0.0:
                low, high, events = 0.0, 0.0, events + 1
            else:
                if worst > FAR and relays < PATIENCE:
                    events, relays = 0, 0
                longer = h * min(5.0, 0.9 / sqrt(sqrt(max(error, 1e-8))))
                h_next = longer if h >= h_next else max(longer, h_next)
    each own:
        q_now[{i}] = {name}
    each kept:
        h_now[{i}] = {name}
    each state:
        x_now[{i}], sizes[3 * {i}] = {name}, size{i}
        sizes[3 * {i} + 1], sizes[3 * {i} + 2] = top{i}, fell{i}
    status[4] = steps
    return 0
"""

# what keeps the switching functions of rests from zero is removed from the states
_ZEROED = """each move:
    if on{i} > 0.0:
        {name} -= a{i} * move{j}_{i}
each rest:
    if on{i} > 0.0:
        a{i} = 0.0
"""


def run_code(hybrid: Hybrid, kind: str) -> str:
    """The function ``run``; ``kind`` "compiled" or "python" (errors of ``math`` are caught).

    u are the external inputs followed by the values held between updates (ticks). An output in
    which a sign or comparison rests has the value that keeps it at rest: the friction of a drive
    held by Coulomb friction is the torque on it, not sign(0).
    """
    program, graph, guarded = hybrid.flow, hybrid.flow.graph, kind != "compiled"
    smooth, leads, jumps, modes = freeze_modes(program.xdot, {node.value for node in program.p})
    slopes = [graph.symbol(f"du{i}") for i in range(len(program.u))]
    made = sliding(program, smooth, leads, jumps)
    equations = Equations(graph, program.t, program.x, program.u, made.rates, slopes)
    after, error = step(equations, divided=True)
    y, shown = resting(program.y, made, modes)
    groups = _groups(hybrid, leads, jumps, made) | {"shown": [{"i": i} for i in shown]}
    rests, fixed = [*made.parts], [] if guarded else [node.value for node in program.p]
    moves = {f"move{j}_{i}": node for i, of in made.moves.items() for j, node in of.items()}
    weights = {f"part{i}": part for i, part in made.parts.items()}
    weights |= {f"step{i}": part for i, part in made.steps.items()}
    own = [*(q.value for q in hybrid.q), *(u.value for u in program.u[len(hybrid.net.outside) :])]
    stepped = after + error if guarded else reciprocals(after + error)
    late = _at_end(program, [*made.parts.values()])
    sections = {
        "step": Section(_named("ne", range(len(program.x))), stepped, "w", fixed),
        "leads": Section(_named("a", range(len(leads))), leads, "c", fixed),
        "leads_after": Section(_named("l", range(len(leads))), _at_end(program, leads), "d", fixed),
        "outputs": Section([f"row{i}[k]" for i in range(len(y))], y, "o", fixed),
        "weights": Section([*weights, *moves], [*weights.values(), *moves.values()], "rest", fixed),
        "weights_after": Section(_named(["end_part"], rests), late, "late", fixed),
        "updates": Section(own, hybrid.ticked, "k", fixed, at_once=True),
    }
    lines = {key: section.lines(guarded) for key, section in sections.items()}
    lines["fixed"] = [line for section in sections.values() for line in section.emitter.head]
    lines["zeroed"] = written(_ZEROED, groups, {}).splitlines()
    return written(
        _RUN,
        groups,
        lines,
        robust="".join(part.robust() for part in sections.values()) if guarded else "",
        moving=bool(program.x),
        nesting=nesting(leads),
        rests=len(rests),
        near=" or ".join(f"on{i} > 0.0 or abs(a{i}) <= DEAD * r{i}" for i in rests),
        sum_of_rests=" + ".join(f"on{i}" for i in rests),
        error=summed([f"error{i} * error{i}" for i in range(len(program.x))]),
        total=summed([f"0.0 * {name}" for name in own]),
    )


def _named(letters: Iterable[str], numbers: Iterable[int]) -> list[str]:
    return [f"{letter}{i}" for letter in letters for i in [*numbers]]


def _groups(
    hybrid: Hybrid, leads: Sequence[Node], jumps: Sequence[bool], made: Sliding
) -> dict[str, list[dict[str, Any]]]:
    """What the code has several of: numbers and names."""
    flow, rests = hybrid.flow, [*made.parts]
    inputs, states = ([node.value for node in of] for of in (flow.u, flow.x))
    free = len(hybrid.net.outside)
    read = {i: bool(symbols_in([leads[i]]) & {*inputs}) for i in rests}
    lead = [
        {"i": i, "jump": int(jump), "free": f"on{i} == 0.0" if i in made.parts else True}
        for i, jump in enumerate(jumps)
    ]
    return {
        "parameter": numbered([node.value for node in flow.p]),
        "state": numbered(states),
        "own": numbered([q.value for q in hybrid.q]),
        "kept": numbered(inputs[free:]),
        "free": numbered(inputs[:free]),
        "input": numbered(inputs),
        "row": numbered(flow.y),
        "before": numbered(inputs[free:] if hybrid.net.earlier else ()),
        "ticked": [{}] if hybrid.ticked else [],
        "flag": numbered(range(hybrid.net.groups)),
        "lead": lead,
        "rest": [{"i": i} for i in rests],
        "resting": [{}] if rests else [],
        "driven": [{"i": i} for i in rests if read[i]],
        "move": [{"i": i, "j": j, "name": states[j]} for i in rests for j in made.moves[i]],
    }


def _at_end(program: Program, leads: Sequence[Node]) -> list[Node]:
    """The switching functions in terms of the state, inputs and time after the step."""
    graph = program.graph
    to = {x.index: graph.symbol(f"n{i}") for i, x in enumerate(program.x)}
    to |= {u.index: graph.symbol(f"v{i}") for i, u in enumerate(program.u)}
    to[program.t.index] = program.t + graph.symbol("h")
    return rename(leads, to)


def nesting(leads: Sequence[Node]) -> int:
    """The longest chain of switching functions, each of which depends on the side of the next."""
    depths: dict[str, int] = {}
    for i, lead in enumerate(leads):
        inner = [depths[name] for name in symbols_in([lead]) if name in depths]
        depths[f"m{i}"] = 1 + max(inner, default=0)
    return max(depths.values(), default=1)
