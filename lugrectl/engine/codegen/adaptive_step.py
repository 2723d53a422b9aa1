"""Code of a run: updates of sampled blocks, and steps that end on the time grid and at switches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..expression.graph import Node, rename, symbols_in
from ..tracing.tracer import Hybrid, Program
from .events import Sliding, exactly_at_zero, freeze_modes, names, resting, settle, sliding
from .python_source import Section, indent, reciprocals, summed
from .rosenbrock import Equations, step

HELPERS = """
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
"""

REST = """

@small
def outside(part, step):  # how far the weight of a rest is from (0, 1)
    return DEAD + max(-part, part - 1.0) if step < 0.0 else inf


@small
def margin(part):
    return (0.5 - abs(part - 0.5)) / DEAD
"""

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

{helpers}
{robust}
@fast
def run(
    grid, given, ticks, flags, held, p, rtol, floor, x_now, q_now, h_now, sizes, x_out, q_out,
    y_out, status
):
{unpack}
{fixed}
    h_next, v_low, v_high, last, tries, steps = 0.0, 0.0, 0.0, 0, 0, 0
    for k in range(len(grid)):
        t, dt, done, low, high, events, relays = grid[k], 0.0, 0.0, 0.0, 0.0, 0, 0
        first_step, due = steps, 0.0
{interval}
        for again in range({nesting} if k == 0 or ticks[k] else 1):
{sides}
{widest}
        fresh = True
        while fresh or done < dt:
{settle}
            if fresh:
                fresh = False
{store}
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
{step}
            steps += 1
            stuck = False
            if steps - first_step >= TRIALS:
                stuck, first_step, due = done <= due, steps, done + 1e-5 * dt
{weights}
            error = sqrt({error}) / rtol
            if stuck or not error <= 1.0 and not (relays >= PATIENCE and error < inf):
                h_next = h * max(0.1, 0.9 / sqrt(sqrt(error))) if error < inf else 0.1 * h
                low, high = 0.0, 0.0
                if stuck or h_next < 1e-13 * dt or t + h_next == t:
                    status[0], status[1], status[4] = k, t, steps
{blame}
                    return 1
                continue
{leads}
            crossed = worst < -1.0 and events < 2 * PATIENCE
            if crossed and low == 0.0 and high == 0.0:
                flipped = False
{flip_at_start}
                if flipped:
                    continue
                first = 1e300
{before}
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
{accept}
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
{keep}
    status[4] = steps
    return 0
"""

_TICK = """
if ticks[k]:
{flags}
{tick}
    if not isfinite({total}):
{keep}
        status[1] = t
        return 2
"""


def run_code(hybrid: Hybrid, kind: str) -> str:
    """The function ``run``; ``kind`` "compiled" or "python" (errors of ``math`` are caught).

    x are the continuous states, q the sampled ones, u the external inputs followed by the values
    held between updates (ticks). An output in which a sign or comparison rests (``sliding``) has
    the value that keeps it at rest: the friction of a drive held by Coulomb friction is the torque
    on it, not sign(0).
    """
    program = hybrid.flow
    parts = _parts(hybrid)
    fixed = [node.value for node in program.p] if kind == "compiled" else []
    nodes, states, switches = parts.step, range(len(parts.states)), range(len(parts.leads))
    if kind == "compiled":
        nodes = reciprocals(nodes)
    step_code = Section([f"{letter}{i}" for letter in "ne" for i in states], nodes, "w", fixed)
    start = Section([f"a{i}" for i in switches], parts.leads, "c", fixed)
    end = Section([f"l{i}" for i in switches], _at_end(program, parts.leads), "d", fixed)
    shown = Section([f"row{i}[k]" for i in range(len(parts.y))], parts.y, "o", fixed)
    rest, after = _rests(program, parts, fixed)
    updates = Section([*parts.own, *parts.held], hybrid.ticked, "k", fixed, at_once=True)
    sections = (step_code, start, end, shown, rest, after, updates)
    guarded = kind != "compiled"
    near = nearest_zero(parts, after.lines(guarded))
    ends = [f"v{i} = {u} + h * d{u}" for i, u in enumerate(parts.inputs)]
    return _RUN.format(
        helpers=HELPERS + (REST if parts.slides.parts else ""),
        robust="".join(part.robust() for part in sections) if guarded else "",
        unpack=indent(_unpack(program, parts), 1),
        fixed=indent([line for part in sections for line in part.emitter.head], 1),
        interval=indent(_interval(hybrid, parts, updates.lines(guarded)), 2),
        nesting=nesting(parts.leads),
        sides=indent(start.lines(guarded) + start_sides(parts), 3),
        widest=indent([f"r{i} = widest(r{i}, a{i})" for i in switches], 2),
        settle=indent(settle(parts.slides, parts.states, rest.lines(guarded)), 3),
        store=indent(_stored(parts, shown.lines(guarded)), 4),
        step=indent(step_code.lines(guarded), 3),
        weights=indent([line.format(i) for i in states for line in _WEIGHT], 3),
        error=summed([f"error{i} * error{i}" for i in states]),
        blame=indent(["largest = -1.0", *(k.format(i) for i in states for k in _BLAME)], 5),
        leads=indent(ends + end.lines(guarded) + near, 3),
        before=indent(nearest_before(parts), 4),
        flip_at_start=indent(turns(parts, at_start=True), 4),
        accept=indent(_accept(parts), 3),
        keep=indent(_kept(parts), 1),
    )


# the error relative to the size; divides only if a state grows
_WEIGHT = ("error{0} = e{0} * (inv{0} if abs(n{0}) <= size{0} else 1.0 / abs(n{0}))",)
# the state with the largest error, or the first that is NaN
_BLAME = (
    "part = abs(error{0})",
    "if largest == largest and not part <= largest:",
    "    status[2], largest = {0}, part",
)
# the size after a step of length h to the absolute value z; divides only if it changes
_SIZE = (
    "z = abs(x{0})",
    "if z > size{0}:",
    "    size{0}, top{0}, fell{0} = z, max(top{0}, z), 0.0",
    "    inv{0} = 1.0 / size{0}",
    "elif z >= 0.5 * size{0}:",
    "    fell{0} = fell{0} + h if z < 0.9 * size{0} else 0.0",
    "else:",
    "    size{0} = max(z, size{0} * (fell{0} / (fell{0} + 0.5 * h)), SMALL * top{0}, floor)",
    "    inv{0} = 1.0 / size{0}",
)


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of the code: names, and nodes."""

    states: list[str]
    inputs: list[str]
    own: list[str]  # of the sampled states
    held: list[str]
    step: list[Node]
    leads: list[Node]
    jumps: list[bool]
    slides: Sliding
    y: list[Node]
    shown: list[int]  # the jumps whose rest is seen in y


def _parts(hybrid: Hybrid) -> Parts:
    program, graph = hybrid.flow, hybrid.flow.graph
    smooth, leads, jumps, modes = freeze_modes(program.xdot, {node.value for node in program.p})
    slopes = [graph.symbol(f"du{i}") for i in range(len(program.u))]
    slides = sliding(program, smooth, leads, jumps)
    equations = Equations(graph, program.t, program.x, program.u, slides.rates, slopes)
    after, error = step(equations, divided=True)
    y, shown = resting(program.y, slides, modes)
    states, inputs = ([node.value for node in nodes] for nodes in (program.x, program.u))
    own, held = [q.value for q in hybrid.q], inputs[len(hybrid.net.outside) :]
    return Parts(states, inputs, own, held, after + error, leads, jumps, slides, y, shown)


def _rests(program: Program, parts: Parts, fixed: Sequence[str]) -> tuple[Section, Section]:
    """The code that decides whether jumps rest, before a step and after it."""
    slides = parts.slides
    weights = [*slides.parts.values(), *slides.steps.values()]
    moves = {f"move{j}_{i}": n for i, m in slides.moves.items() for j, n in m.items()}
    late = _at_end(program, weights[: len(slides.parts)])
    return (
        Section([*names(slides), *moves], [*weights, *moves.values()], "rest", fixed),
        Section(names(slides, "end_")[: len(late)], late, "late", fixed),
    )


def _at_end(program: Program, leads: Sequence[Node]) -> list[Node]:
    """The switching functions in terms of the state, inputs and time after the step."""
    graph = program.graph
    to = {x.index: graph.symbol(f"n{i}") for i, x in enumerate(program.x)}
    to |= {u.index: graph.symbol(f"v{i}") for i, u in enumerate(program.u)}
    to[program.t.index] = program.t + graph.symbol("h")
    return rename(leads, to)


def _unpack(program: Program, parts: Parts) -> list[str]:
    lines = [f"{p.value} = p[{i}]" for i, p in enumerate(program.p)]
    for i, x in enumerate(parts.states):
        lines += [f"{x}, states{i} = x_now[{i}], x_out[{i}]"]
        lines += [f"size{i} = max(abs({x}), floor, sizes[{3 * i}])", f"inv{i} = 1.0 / size{i}"]
        lines += [f"top{i}, fell{i} = max(size{i}, sizes[{3 * i + 1}]), sizes[{3 * i + 2}]"]
    lines += [f"{q}, own{i} = q_now[{i}], q_out[{i}]" for i, q in enumerate(parts.own)]
    lines += [f"{u} = h_now[{i}]" for i, u in enumerate(parts.held)]
    lines += [f"in{i} = given[{i}]" for i in range(len(parts.inputs) - len(parts.held))]
    lines += [f"row{i} = y_out[{i}]" for i in range(len(parts.y))]
    lines += [f"{letter}{i} = 0.0" for i in range(len(parts.leads)) for letter in "mr"]
    return lines + [f"{name}{i} = 0.0" for i in parts.slides.parts for name in ("on", "part")]


def _kept(parts: Parts) -> list[str]:
    """Where a run has come to, and the sizes of the states there."""
    lines = [f"q_now[{i}] = {q}" for i, q in enumerate(parts.own)]
    lines += [f"h_now[{i}] = {u}" for i, u in enumerate(parts.held)]
    for i, x in enumerate(parts.states):
        names = f"x_now[{i}]", *(f"sizes[{3 * i + j}]" for j in range(3))
        lines += [f"{', '.join(names)} = {x}, size{i}, top{i}, fell{i}"]
    return lines


def _interval(hybrid: Hybrid, parts: Parts, updates: Sequence[str]) -> list[str]:
    """Code ahead of the steps of an interval: its length, its update, and the inputs in it."""
    free = range(len(parts.inputs) - len(parts.held))
    lines = [f"own{i}[k] = {q}" for i, q in enumerate(parts.own)]
    lines += [f"u{i} = in{i}[k]" for i in free]
    if hybrid.net.earlier:
        lines += [f"b{i} = {u}" for i, u in enumerate(parts.held)]
    if hybrid.ticked:
        code = _TICK.format(
            flags=indent([f"g{i} = flags[{i}][k]" for i in range(hybrid.net.groups)], 1),
            tick=indent(updates, 1),
            total=summed([f"0.0 * {name}" for name in (*parts.own, *parts.held)]),
            keep=indent(_kept(parts), 2),
        )
        lines += code.strip().split("\n")
    lines += [f"du{i} = 0.0" for i in range(len(parts.inputs))]
    if not parts.states:
        return lines
    lines += ["if k < len(grid) - 1:", "    dt = grid[k + 1] - t"]
    lines += [f"    du{i} = 0.0 if held else (in{i}[k + 1] - in{i}[k]) / dt" for i in free]
    return [*lines, "if k == 0:", "    h_next = 0.01 * dt"]


def _stored(parts: Parts, outputs: Sequence[str]) -> list[str]:
    lines = [f"way{i} = m{i} if a{i} == 0.0 else side(a{i})" for i in parts.shown]
    return [*lines, *outputs, *(f"states{i}[k] = {x}" for i, x in enumerate(parts.states))]


def _accept(parts: Parts) -> list[str]:
    lines = turns(parts, at_start=False)
    lines += [f"a{i} = l{i}" for i in range(len(parts.leads))]
    lines += [f"{x} = n{i}" for i, x in enumerate(parts.states)]
    lines += exactly_at_zero(parts.slides, parts.states)
    lines += [line.format(i) for i in range(len(parts.states)) for line in _SIZE]
    return lines + [f"{u} = v{i}" for i, u in enumerate(parts.inputs)]


def start_sides(parts: Parts) -> list[str]:
    """The sides at the start of an interval, where inputs may have jumped."""
    lines = []
    for i, lead in enumerate(parts.leads):
        if i in parts.slides.parts and symbols_in([lead]) & {*parts.inputs}:
            lines += [f"on{i} = on{i} if abs(a{i}) <= DEAD * r{i} else 0.0"]
        lines += _unless_resting(parts, i, [f"m{i} = started(m{i}, a{i}, r{i})"])
    return lines


def nesting(leads: Sequence[Node]) -> int:
    """The longest chain of switching functions, each of which depends on the side of the next."""
    depths: dict[str, int] = {}
    for i, lead in enumerate(leads):
        inner = [depths[name] for name in symbols_in([lead]) if name in depths]
        depths[f"m{i}"] = 1 + max(inner, default=0)
    return max(depths.values(), default=1)


def _unless_resting(parts: Parts, i: int, lines: Sequence[str]) -> list[str]:
    """The lines, executed only if a switching function does not rest."""
    if i not in parts.slides.parts:
        return [*lines]
    return [f"if on{i} == 0.0:", *("    " + line for line in lines)]


def nearest_zero(parts: Parts, weights: Sequence[str]) -> list[str]:
    """The distance of the nearest switching function from zero, in widths of its dead band."""
    lines = ["worst = 1e300"]
    for i in range(len(parts.leads)):
        far = f"distance(m{i}, l{i}, a{i}, r{i})"
        lines += [f"r{i} = widest(r{i}, l{i})"]
        lines += _unless_resting(parts, i, [f"worst = nearest(worst, {far})"])
    if not parts.slides.parts:
        return lines
    lines += [f"if {' + '.join(f'on{i}' for i in parts.slides.parts)} > 0.0:"]
    lines += ["    " + line for line in weights]
    for i in parts.slides.parts:
        lines += [f"    if on{i} > 0.0:", f"        worst = nearest(worst, margin(end_part{i}))"]
    return lines


def nearest_before(parts: Parts) -> list[str]:
    """The same at the start of a step."""
    lines = []
    for i in range(len(parts.leads)):
        far = f"first_distance(m{i}, a{i}, r{i})"
        lines += _unless_resting(parts, i, [f"first = nearest(first, {far})"])
        if i in parts.slides.parts:
            lines += ["else:", f"    first = nearest(first, margin(part{i}))"]
    return lines


def turns(parts: Parts, *, at_start: bool) -> list[str]:
    """Changes sides that a trial step from zero has shown to be wrong, or that a step has left."""
    lines = []
    for i, jump in enumerate(parts.jumps):
        count = ["    events += 1"] + ["    relays += 1"] * jump
        if at_start:
            turn = [f"if misled(m{i}, l{i}, a{i}, r{i}):", f"    m{i} = side(l{i})", *count]
            lines += _unless_resting(parts, i, [*turn, "    flipped = True"])
        else:
            turn = [f"if passed(m{i}, l{i}, r{i}):", *count, f"m{i} = turned(m{i}, l{i}, r{i})"]
            lines += _unless_resting(parts, i, turn)
    return lines
