"""Code of an adaptive run whose steps end on the time grid and at kinks and jumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..expression.graph import Node, rename, symbols_in
from ..tracing.tracer import Hybrid, Program, Tick
from .events import Sliding, exactly_at_zero, freeze_modes, names, settle, sliding
from .python_source import Emitter, Section, early_first, indent, reciprocals, summed
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
def run(grid, u, held, x_start, p, rtol, floor, x_out, status):
{unpack}
{fixed}
{sizes_before}
    h_next = 0.01 * (grid[1] - grid[0])
    v_low, v_high, last, tries, steps = 0.0, 0.0, 0, 0, 0
    for k in range(len(grid) - 1):
        dt = grid[k + 1] - grid[k]
        t, done, low, high, events, relays = grid[k], 0.0, 0.0, 0.0, 0, 0
        first_step, due = steps, 0.0
{interval}
        for again in range({nesting} if k == 0 else 1):
{sides}
{sizes}
        while done < dt:
{settle}
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
                    return False
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
{store}
{sizes_after}
    status[4] = steps
    return True
"""


def adaptive_code(program: Program, kind: str) -> str:
    """The function ``run``; ``kind`` "compiled" or "python" (errors of ``math`` are caught)."""
    parts = _parts(program)
    fixed = [node.value for node in program.p] if kind == "compiled" else []
    nodes, states, switches = parts.step, range(len(parts.states)), range(len(parts.leads))
    if kind == "compiled":
        nodes = early_first(reciprocals(nodes), parts.states)
    step_code = Section([f"{letter}{i}" for letter in "ne" for i in states], nodes, "b", fixed)
    start = Section([f"a{i}" for i in switches], parts.leads, "c", fixed)
    end = Section([f"l{i}" for i in switches], _at_end(program, parts.leads), "d", fixed)
    rest, after = _rests(program, parts, fixed)
    sections = (step_code, start, end, rest, after)
    guarded = kind != "compiled"
    near = nearest_zero(parts, after.lines(guarded))
    ends = [f"v{i} = {u} + h * d{u}" for i, u in enumerate(parts.inputs)]
    return _RUN.format(
        helpers=HELPERS + (REST if parts.slides.parts else ""),
        robust="".join(part.robust() for part in sections) if guarded else "",
        unpack=indent(_unpack(program, parts), 1),
        fixed=indent([line for part in sections for line in part.emitter.head], 1),
        sizes_before=indent(_sizes(len(states), after=False), 1),
        sizes_after=indent(_sizes(len(states), after=True), 1),
        interval=indent(_interval(parts), 2),
        nesting=nesting(parts.leads),
        sides=indent(start.lines(guarded) + start_sides(parts), 3),
        sizes=indent([f"r{i} = widest(r{i}, a{i})" for i in switches], 2),
        settle=indent(settle(parts.slides, parts.states, rest.lines(guarded)), 3),
        step=indent(step_code.lines(guarded), 3),
        weights=indent([line.format(i) for i in states for line in _WEIGHT], 3),
        error=summed([f"g{i} * g{i}" for i in states]),
        blame=indent(["largest = -1.0", *(k.format(i) for i in states for k in _BLAME)], 5),
        leads=indent(ends + end.lines(guarded) + near, 3),
        before=indent(nearest_before(parts), 4),
        flip_at_start=indent(turns(parts, at_start=True), 4),
        accept=indent(_accept(parts), 3),
        store=indent([f"out{i}[k + 1] = {x}" for i, x in enumerate(parts.states)], 2),
    )


# the error relative to the size; divides only if a state grows
_WEIGHT = "o{0} = q{0} if abs(n{0}) <= s{0} else 1.0 / abs(n{0})", "g{0} = e{0} * o{0}"
# the state with the largest error, or the first that is NaN
_BLAME = (
    "part = abs(g{0})",
    "if largest == largest and not part <= largest:",
    "    status[2], largest = {0}, part",
)
# the size s after a step of length h to the absolute value z; divides only if it changes
_SIZE = (
    "if z{0} > s{0}:",
    "    s{0}, b{0}, w{0} = z{0}, max(b{0}, z{0}), 0.0",
    "    q{0} = 1.0 / s{0}",
    "elif z{0} >= 0.5 * s{0}:",
    "    w{0} = w{0} + h if z{0} < 0.9 * s{0} else 0.0",
    "else:",
    "    s{0} = max(z{0}, s{0} * (w{0} / (w{0} + 0.5 * h)), SMALL * b{0}, floor)",
    "    q{0} = 1.0 / s{0}",
)


def _parts(program: Program) -> Parts:
    graph = program.graph
    smooth, leads, jumps = freeze_modes(program.xdot, {node.value for node in program.p})
    slopes = [graph.symbol(f"du{i}") for i in range(len(program.u))]
    slides = sliding(program, smooth, leads, jumps)
    equations = Equations(graph, program.t, program.x, program.u, slides.rates, slopes)
    after, error = step(equations, divided=True)
    states, inputs = ([node.value for node in nodes] for nodes in (program.x, program.u))
    return Parts(states, inputs, after + error, leads, jumps, slides)


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
    for i, x in enumerate(program.x):
        lines += [f"{x.value} = x_start[{i}]", f"s{i} = b{i} = max(abs({x.value}), floor)"]
        lines += [f"w{i} = 0.0", f"q{i} = 1.0 / s{i}"]
        lines += [f"out{i} = x_out[{i}]", f"out{i}[0] = {x.value}"]
    lines += [f"in{i} = u[{i}]" for i in range(len(program.u))]
    lines += [f"{letter}{i} = 0.0" for i in range(len(parts.leads)) for letter in "mr"]
    return lines + [f"on{i} = 0.0" for i in parts.slides.parts]


def _sizes(states: int, *, after: bool) -> list[str]:
    """The sizes of the states in an earlier part of the run, where status has room for them."""
    lines = ["if len(status) > 5:"]
    for i in range(states):
        for k, name in enumerate((f"s{i}", f"b{i}", f"w{i}")):
            place = f"status[{5 + 3 * i + k}]"
            taken = f"float({place})" if name[0] == "w" else f"max({name}, float({place}))"
            lines += [f"    {place} = {name}" if after else f"    {name} = {taken}"]
        lines += [] if after else [f"    q{i} = 1.0 / s{i}"]
    return lines if states else []


def _interval(parts: Parts) -> list[str]:
    lines = []
    for i, u in enumerate(parts.inputs):
        slope = f"0.0 if held else (in{i}[k + 1] - in{i}[k]) / dt"
        lines += [f"{u} = in{i}[k]", f"d{u} = {slope}"]
    return lines


def _accept(parts: Parts) -> list[str]:
    lines = turns(parts, at_start=False)
    lines += [f"a{i} = l{i}" for i in range(len(parts.leads))]
    lines += [f"{x} = n{i}" for i, x in enumerate(parts.states)]
    lines += exactly_at_zero(parts.slides, parts.states)
    for i, x in enumerate(parts.states):
        lines += [f"z{i} = abs({x})", *(line.format(i) for line in _SIZE)]
    return lines + [f"{u} = v{i}" for i, u in enumerate(parts.inputs)]


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of the code."""

    states: list[str]
    inputs: list[str]
    step: list[Node]
    leads: list[Node]
    jumps: list[bool]
    slides: Sliding


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


# The intermediate results of a block fit into the processor's cache.
_BLOCKS = """
def outputs(t, x, u, p, y):
    {scales}
    for first in range(0, len(t), 4096):
        part = slice(first, first + 4096)
        block(t[part], x[:, part], u[:, part], p, y[:, part], scales)


def block(t, x, u, p, y, scales):
{code}
"""

_LEADS = """

def leads(t, x, u, p):
{code}
"""


def output_code(program: Program) -> str:
    """The function ``outputs(t, x, u, p, y)``.

    A sign or comparison that rests (``sliding``) has the value that keeps it at rest: the
    friction of a drive held by Coulomb friction is the torque on it, not sign(0). If its
    switching function depends on an input it has NumPy's value.
    """
    roots, fixed = [*program.xdot, *program.y], {node.value for node in program.p}
    smooth, leads, jumps = freeze_modes(roots, fixed)
    inputs = {node.value for node in program.u}
    wanted = [
        jump and not symbols_in([lead]) & inputs for lead, jump in zip(leads, jumps, strict=True)
    ]
    slides = sliding(program, smooth, leads, wanted)
    seen, n = symbols_in(smooth[len(program.x) :]), len(program.x)
    code, targets = unpacked(program), [f"y[{i}]" for i in range(len(program.y))]
    if not any(f"m{i}" in seen for i in slides.parts):
        code += _write(program.y, "v", targets)
        return _BLOCKS.format(scales="scales = ()", code=indent(code, 1))
    for i, lead in enumerate(leads):  # all sides by NumPy's rules
        code += _write([lead], f"lead{i}_", [f"a{i}"]) + [f"m{i} = np.sign(a{i})"]
    values = "".join(f"a{i}, " for i in slides.parts)
    own = [*code, *_resting(program, slides), *_write(slides.rates[n:], "v", targets)]
    return _BLOCKS.format(
        scales="scales = [np.nanmax(abs(a)) for a in leads(t, x, u, p)]", code=indent(own, 1)
    ) + _LEADS.format(code=indent([*code, f"return {values}"], 1))


def unpacked(program: Program) -> list[str]:
    """Code that gives the rows of the arguments their names."""
    rows = (("x", program.x), ("u", program.u), ("p", program.p))
    return [f"{node.value} = {name}[{i}]" for name, nodes in rows for i, node in enumerate(nodes)]


def _write(nodes: Sequence[Node], prefix: str, targets: Sequence[str]) -> list[str]:
    emitter = Emitter("array", prefix)
    codes = emitter.write(nodes)
    return emitter.body + [f"{name} = {code}" for name, code in zip(targets, codes, strict=True)]


def _resting(program: Program, made: Sliding) -> list[str]:
    """The code of ``settle``, for all samples at once."""
    lines = [f"du{i} = 0.0" for i in range(len(program.u))]
    for scale, i in enumerate(made.parts):
        lines += [f"on{i} = 1.0 * (abs(a{i}) <= 1e-11 * scales[{scale}])"]
        lines += [f"m{i} = np.where(on{i} > 0.0, 1.0, m{i})"]
    turn = _write([*made.parts.values(), *made.steps.values()], "rest", names(made))
    for i in made.parts:
        off = f"np.where(step{i} < 0.0, np.maximum(-part{i}, part{i} - 1.0), inf)"
        turn += [f"off{i} = np.where(on{i} > 0.0, {off}, -1.0)"]
    turn += [f"worst = np.maximum.reduce([{', '.join(f'off{i}' for i in made.parts)}])"]
    for i in made.parts:
        turn += [
            f"leaves = ~(off{i} < 0.0) & (off{i} >= worst)",
            f"side = np.where(off{i} < inf, np.where(part{i} < 0.5, 1.0, -1.0), np.sign(a{i}))",
            f"m{i}, on{i} = np.where(leaves, side, m{i}), np.where(leaves, 0.0, on{i})",
        ]
    return lines + [f"for _ in range({len(made.parts) + 1}):", *("    " + line for line in turn)]


# x are the continuous states, q the sampled ones, u the external inputs followed by the values
# held between updates (ticks). column[k] is where the grid point is stored, -1: not stored.
_ALTERNATE = """
import numpy as np

{robust}
@fast
def alternate(
    grid, given, ticks, flags, column, held, p, rtol, floor, x, q, h, x_out, q_out, h_out, b_out,
    status
):
{unpack}
{head}
    last, k = len(grid) - 1, 0
    while True:
        c = column[k]
        if c >= 0:
{before}
        if ticks[k]:
            t = grid[k]
{read}
{tick}
            if not isfinite({total}):
{keep}
                status[1] = t
                return 2
        if c >= 0:
{store}
        if k == last:
{keep_last}
            return 0
        j = k + 1
        while j < last and not ticks[j]:
            j += 1
{flow}
        k = j
"""

_COMPILED_FLOW = """
size = j - k + 1
times, rows, part = np.empty(size), np.empty(({inputs}, size)), np.empty(({states}, size))
for i in range(size):
    times[i] = grid[k + i]
{rows}
"""

_PYTHON_FLOW = """
size = j - k + 1
times, part = grid[k : j + 1], [[0.0] * size for _ in range({states})]
rows = [{rows}]
"""

_ADVANCE = """
if not run(times, rows, held, x, p, rtol, floor, part, status):
    return 1
for i in range(1, size - 1):
    c = column[k + i]
    if c >= 0:
{store}
{end}
"""


def held_code(hybrid: Hybrid, tick: Tick, kind: str) -> str:
    """The function ``alternate``, with the ``run`` of the flow, for a kind as in that."""
    flow, outside, guarded = hybrid.flow, range(len(hybrid.net.outside)), kind == "python"
    fixed = [] if guarded else [node.value for node in flow.p]
    held, own = [node.value for node in flow.u[len(outside) :]], [q.value for q in tick.q]
    updates = Section([*own, *held], hybrid.ticked, "k", fixed, at_once=True)
    given = [f"given{i} = given[{i}]" for i in outside]
    unpack = [f"{p.value} = p[{i}]" for i, p in enumerate(flow.p)] + given
    unpack += _each("{1} = q[{0}]", own) + _each("{1} = h[{0}]", held)
    keep = indent(_each("q[{0}] = {1}", own) + _each("h[{0}] = {1}", held), 3)
    states = [x.value for x in flow.x]
    read = _each("{1} = x[{0}]", states) + [f"u{i} = given{i}[k]" for i in outside]
    store_q, store_h = _each("q_out[{0}][c] = {1}", own), _each("h_out[{0}][c] = {1}", held)
    store_b = _each("b_out[{0}][c] = {1}", held) if hybrid.net.earlier else []
    text = _ALTERNATE.format(
        robust=updates.robust() if guarded else "",
        unpack=indent(unpack, 1),
        head=indent(updates.emitter.head, 1),
        before=indent(store_q + store_b, 3),
        read=indent(read + [f"{g.value} = flags[{i}][k]" for i, g in enumerate(tick.g)], 3),
        tick=indent(updates.lines(guarded), 3),
        total=summed([f"0.0 * {name}" for name in (*own, *held)]),
        keep=indent(keep.split("\n"), 1),
        keep_last=keep,
        store=indent(_each("x_out[{0}][c] = x[{0}]", states) + store_h, 3),
        flow=indent(_flow(hybrid, kind, held, store_q + store_h + store_b), 2),
    )
    return (adaptive_code(flow, kind) if states else "") + text


def _each(line: str, names: Sequence[str]) -> list[str]:
    return [line.format(i, name) for i, name in enumerate(names)]


def _flow(hybrid: Hybrid, kind: str, held: Sequence[str], kept: Sequence[str]) -> list[str]:
    states, outside = [x.value for x in hybrid.flow.x], range(len(hybrid.net.outside))
    if not states:
        lines = ["for i in range(1, j - k):", "    c = column[k + i]", "    if c >= 0:"]
        return lines + ["        " + line for line in kept or ["pass"]]
    if kind == "compiled":
        rows = [f"rows[{i}, i] = given{i}[k + i]" for i in outside]
        rows += [f"rows[{len(outside) + i}, i] = {name}" for i, name in enumerate(held)]
        inputs = len(hybrid.flow.u)
        text = _COMPILED_FLOW.format(inputs=inputs, states=len(states), rows=indent(rows, 1))
    else:
        rows = [f"given{i}[k : j + 1]" for i in outside]
        rows += [f"[{name}] * size" for name in held]
        text = _PYTHON_FLOW.format(states=len(states), rows=", ".join(rows))
    inside = _each("x_out[{0}][c] = part[{0}][i]", states)
    end = "\n".join(_each("x[{0}] = part[{0}][size - 1]", states))
    return (text + _ADVANCE.format(store=indent(inside + [*kept], 2), end=end)).strip().split("\n")


def signal_code(hybrid: Hybrid) -> str:
    """The function ``signals``: all signals along the kept grid points."""
    flow, emitter = hybrid.flow, Emitter("array")
    codes = emitter.write(flow.y)
    count = len(hybrid.net.held) if hybrid.net.earlier else 0
    lines = unpacked(flow) + [f"b{i} = b[{i}]" for i in range(count)]
    lines += emitter.body + [f"y[{i}] = {code}" for i, code in enumerate(codes)]
    return f"def signals(t, x, u, b, p, y):\n{indent(lines, 1)}\n"
