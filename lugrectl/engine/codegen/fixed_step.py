"""Friction that changes its direction within a fixed step: where it does, and where it holds.

A rate that contains sign(x) of its own state x jumps where x passes zero. Each step is taken with
one direction, +1 or -1, and ends where x reaches zero. There the rates of x on both sides decide:
if that above zero is positive, x moves up; if that below is negative, it moves down; else x is held
at zero (Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, chapter 2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from ..expression.graph import Node, reachable, rename, substitute, symbols_in
from ..expression.numpy_protocol import COMPARISONS, LIBRARY, OPS
from ..tracing.tracer import Program
from .events import average_jumps
from .python_source import Emitter, indent, summed
from .rosenbrock import Equations, step

ZERO = 1e-8  # of a state's scale: within this it has reached zero
HELD = 100.0  # weight of a motion missed by holding a state too long: it is not corrected later
AGAIN = 0.1  # part of a step to try if it starts at zero and ends on the other side
SHORTEST = 1e-3  # of the shortest step for accuracy: the shortest one to a zero

# per kind of code: try a shorter step, its length, the new state at a zero, and a condition
_FILLING = {
    "wide": (
        "back = 1.0 if good > 0.0 and {share} and {long} else 0.0\n"
        "good = 0.0 if back > 0.0 else good\n",
        "growth = share if back > 0.0 else growth",
        "{n} = 0.0 if {land} > 0.0 else {n}",
        " or {} > 0.0",
    ),
    "array": (
        "back = good & ({share}) & ({long})\ngood = good & ~back\n",
        "growth = np.where(back, share, growth)",
        "{n} = np.where({land} > 0.0, 0.0, {n})",
        " | ({} > 0.0)",
    ),
}


@dataclass(frozen=True, eq=False)
class Relay:
    """The state ``place`` whose rate contains its sign.

    ``up`` and ``down`` are its rates just above and just below zero. They may change while it is
    held (``turning``) if they depend on time or on other states. In the code ``side<place>`` is
    the direction of the step, 1.0 or -1.0, 0.0 while the state is held; ``land<place>`` 1.0 if the
    step ends where the state reaches zero.
    """

    place: int
    up: Node
    down: Node
    turning: bool


@dataclass(frozen=True, eq=False)
class Relays:
    """The relays of a program; its rates contain ``side<place>`` and ``free<place>``, 0 if held."""

    program: Program
    rates: list[Node]
    every: tuple[Relay, ...]

    def before(self, kind: str) -> list[str]:
        """Code that decides the direction of each relay, ahead of a step."""
        lines: list[str] = []
        for relay in self.every:
            x, make = self.program.x[relay.place], self.program.graph.make
            held = make("where", relay.up > 0.0, 1.0, make("where", relay.down < 0.0, -1.0, 0.0))
            side = make("where", x > 0.0, 1.0, make("where", x < 0.0, -1.0, held))
            free = abs(self._symbol(f"side{relay.place}"))
            lines += self._written(kind, f"pre{relay.place}_", {f"side{relay.place}": side})
            lines += self._written(kind, f"free{relay.place}_", {f"free{relay.place}": free})
        return lines

    def after(self, kind: str) -> list[str]:
        """Code behind a step to the new states n0, n1, ...: ``share``, the part of the step that
        ends at the first zero; for each relay whether it reached zero; and ``slip``, the motion
        relative to the scale that was missed by holding a state too long."""
        if not self.every:
            return []
        make, shares, slips, made = self.program.graph.make, [], [], {}
        for relay in self.every:
            before = self._symbol(f"side{relay.place}") * self.program.x[relay.place]
            now = self._symbol(f"side{relay.place}") * self._symbol(f"n{relay.place}")
            scale = make("maximum", self._symbol(f"s{relay.place}"), before)
            near = ZERO * scale
            jumps = (relay.down - relay.up) * self._symbol("dt") > near
            part = make("where", before > near, before / (before - now), AGAIN)
            over = make("logical_and", jumps, now < -near)
            shares.append(make("where", over, part, 1.0))
            lands = make("logical_and", jumps, make("logical_and", now <= near, now < before))
            made[f"land{relay.place}"] = make("where", lands, 1.0, 0.0)
            if relay.turning:  # what the state would have moved since, were it not held
                h = self._symbol("h")
                later = {x.index: self._symbol(f"n{i}") for i, x in enumerate(self.program.x)}
                end = self.program.t + h
                later |= {self.program.t.index: end, self._symbol("begin").index: end}
                up, down = rename([relay.up, relay.down], later)
                pull = h * make("maximum", make("maximum", up, -down), 0.0)
                free = self._symbol(f"free{relay.place}") > 0.0
                slips.append(HELD * make("where", free, 0.0, pull) / scale)
        made["share"] = shares[0]
        for share in shares[1:]:
            made["share"] = make("minimum", made["share"], share)
        made["slip"] = self.program.graph.total(slips)
        return self._written(kind, "post", made)

    def filling(self, kind: str) -> dict[str, str]:
        """Code for the places ``before``, ``back``, ``shorten`` and ``landed`` of a step."""
        if not self.every:
            return dict.fromkeys(("before", "back", "shorten", "landed"), "")
        lands = [f"land{relay.place}" for relay in self.every]
        news = [f"n{relay.place}" for relay in self.every]
        again, shorten, choice, joined = _FILLING["array" if kind == "array" else "wide"]
        back = again.format(share="share < 1.0", long=f"h > {SHORTEST} * shortest")
        back += "\n".join(
            choice.format(n=n, land=land) for n, land in zip(news, lands, strict=True)
        )
        return {
            "before": "\n".join(self.before(kind)),
            "back": back,
            "shorten": shorten,
            "landed": "".join(joined.format(land) for land in lands),
        }

    def _symbol(self, name: str) -> Node:
        return self.program.graph.symbol(name)

    def _written(self, kind: str, prefix: str, made: Mapping[str, Node]) -> list[str]:
        begin = {self._symbol("begin").index: self.program.t}
        emitter = Emitter(kind, prefix)
        codes = emitter.write(rename(list(made.values()), begin))
        return [*emitter.body, *(f"{k} = {c}" for k, c in zip(made, codes, strict=True))]


def relays(program: Program) -> Relays:
    """The relays of a program; a condition on time counts by its share of the step."""
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
    every = tuple(_relay(program, rates, i, places) for i in places)
    for i in places:
        rates[i] = graph.symbol(f"free{i}") * rates[i]
    return Relays(program, rates, every)


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
    return Relay(place, up, down, not symbols_in([up, down]) <= still)


def _sign(x: Node) -> Node:
    return x.graph.make("sign", x)


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
{finish}
"""

_ARRAY_STEP = """
{before}
{code}
spent = spent + 1.0
error = np.where(np.isfinite({state}), {error}, 0.0)
good = (error <= rtol) | (h <= shortest)
{back}
{advance}
t = np.where(good, t + h, t)
left = np.where(good, left - h, left)
growth = 0.8 * np.sqrt(np.sqrt(rtol / np.maximum(error, 1e-30)))
growth = np.where(growth == growth, np.clip(growth, 0.1, 5.0), 0.1)
{shorten}
h = np.minimum(left, np.where(good & ((spent > most){landed}), left, h * growth))
shortest = np.where(good & (error > rtol), shortest * {tired}, shortest)
"""

# A diverging run must not take minutes: each rejected shortest step makes the shortest step
# longer, and after too many steps each step tries to finish its substep.
TIRED = 1.005
MOST = 200  # to a substep, on average


def array_code(program: Program) -> str:
    """The function ``run`` for NumPy: all lanes at once."""
    fixed = [node.value for node in program.p]
    at_sample, at_step = Emitter("array", "a", fixed), Emitter("array", "b", fixed)
    outputs = at_sample.write(program.y)
    states = [node.value for node in program.x]
    advance = [f"{x} = np.where(good, n{i}, {x})" for i, x in enumerate(states)]
    inner = trial(program, "array", at_step, _ARRAY_STEP, advance)
    store = [f"y_hat[lane, j, {i}] = {code}" for i, code in enumerate(outputs)]
    scale = [f"s{i} = {_most('array', f's{i}', x)}" for i, x in enumerate(states)]
    return _LOOP.format(
        unpack=indent(unpack(program, "array"), 2),
        fixed=indent(at_sample.head + at_step.head, 2),
        read=indent([f"u{i} = u[own, k, {i}]" for i in range(len(program.u))], 3),
        output=indent(at_sample.body + store, 3),
        correct=indent(correction(outputs, states, "array"), 4),
        scale=indent(scale, 3),
        step=indent(inner, 5),
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


def trial(
    program: Program, kind: str, emitter: Emitter, template: str, advance: Sequence[str]
) -> list[str]:
    """A template of a trial step, filled with the new states n0, n1, ... and its error."""
    states = [node.value for node in program.x]
    switching = relays(program)
    after, estimate = fixed_step(program, switching)
    codes = emitter.write(after + estimate)
    new, errors = codes[: len(states)], codes[len(states) :]
    made = [f"n{i} = {code}" for i, code in enumerate(new)]
    parts = [f"abs({e}) / {_most(kind, f's{i}', f'n{i}')}" for i, e in enumerate(errors)]
    parts += ["slip"] if any(relay.turning for relay in switching.every) else []
    text = template.format(
        tired=TIRED,
        code="\n".join([*emitter.body, *made, *switching.after(kind)]),
        error=summed(parts),
        state=summed(states),
        advance="\n".join(advance),
        **switching.filling(kind),
    )
    return [line for line in text.split("\n") if line]


def fixed_step(program: Program, switching: Relays) -> tuple[list[Node], list[Node]]:
    """The state after a step of length h with held inputs, and its error."""
    equations = Equations(
        graph=program.graph, t=program.t, x=program.x, u=program.u, xdot=switching.rates
    )
    begin = {program.graph.symbol("begin").index: program.t}
    new, error = step(equations)
    return rename(new, begin), rename(error, begin)


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
    lane_at, sample_at = np.zeros({width}, int), np.zeros({width}, int)
    turn_at = np.zeros({width}, int)
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

# a place without a lane makes steps of zero length, which change nothing
_STEP = """
{before}
{code}
error = ({error}) if abs({state}) < inf else 0.0
good = 1.0 if error <= rtol or h <= shortest else 0.0
{back}
tired = {tired} if error > rtol else 1.0
shortest_at[l] = shortest * tired if good > 0.0 else shortest
growth = 0.8 * sqrt(sqrt(rtol / max(error, 1e-30)))
growth = min(max(growth, 0.1), 5.0) if growth == growth else 0.1
{shorten}
left = left - h if good > 0.0 else left
t_at[l] = t + h if good > 0.0 else t
left_at[l] = left
spent_at[l] = spent + 1.0
h_at[l] = left if good > 0.0 and (spent > most{landed}) else min(left, h * growth)
{advance}
"""


def is_wide(program: Program) -> bool:
    """Whether each operation of a program's step is available for several numbers at once."""
    new, error = fixed_step(program, relays(program))
    calls = {OPS[n.op].scalar.partition("(")[0] for n in reachable(new + error) if n.args}
    return {call for call in calls if call.isidentifier()} <= {*LIBRARY, *PLAIN}


def lane_code(program: Program, kind: str, width: int) -> str:
    """The function ``run``, which works through the lanes by blocks; ``kind`` "wide" can be
    vectorised, "scalar" has all functions."""
    fixed = [node.value for node in program.p]
    at_sample, at_step = Emitter(kind, "a", fixed), Emitter(kind, "b", fixed)
    outputs = at_sample.write(program.y)
    states, inputs = ([node.value for node in of] for of in (program.x, program.u))
    advance = [f"{x}_at[l] = n{i} if good > 0.0 else {x}" for i, x in enumerate(states)]
    step = trial(program, kind, at_step, _STEP, advance)
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
        step=indent(step, 3),
    )


def _kept(names: Iterable[str]) -> list[str]:
    return [f"{name}_at[l] = {name}" for name in names]


def _loaded(names: Iterable[str]) -> list[str]:
    return [f"{name} = {name}_at[l]" for name in names]
