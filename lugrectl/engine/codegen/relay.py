"""Friction that changes its direction within a fixed step: where it does, and where it holds.

A rate that contains sign(x) of its own state x jumps where x passes zero. Each step is taken with
one direction, +1 or -1, and ends where x reaches zero. There the rates of x on both sides decide:
if that above zero is positive, x moves up; if that below is negative, it moves down; else x is held
at zero (Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, chapter 2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ..expression.graph import Node, reachable, rename, substitute, symbols_in
from ..expression.operations import COMPARISONS
from ..tracing.equations import Program
from .python_source import Emitter
from .switching import average_jumps

ZERO = 1e-8  # of a state's scale: within this it has reached zero
HELD = 100.0  # weight of a motion missed by holding a state too long: it is not corrected later
AGAIN = 0.1  # part of a step to try if it starts at zero and ends on the other side
SHORTEST = 1e-3  # of the shortest step for accuracy: the shortest one to a zero

# per kind of code: try a shorter step, its length, the new state at a zero, and a condition
_FILLING = {
    "scalar": (
        "if {share} and {long}:\n    h = h * share\n    continue\n",
        "",
        "{n} = 0.0 if {land} > 0.0 else {n}",
        " or {} > 0.0",
    ),
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
    """The relays of a program, and its rates within a step.

    The rates contain the symbol ``side<place>`` for the sign of a state, and ``free<place>``, 0
    while the state is held, else 1.
    """

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
            if relay.turning:
                slips.append(HELD * self._slip(relay) / scale)
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
        again, shorten, choice, joined = _FILLING[kind]
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

    def _slip(self, relay: Relay) -> Node:
        graph, program = self.program.graph, self.program
        h, make = graph.symbol("h"), graph.make
        later = {x.index: graph.symbol(f"n{i}") for i, x in enumerate(program.x)}
        later |= {program.t.index: program.t + h, graph.symbol("begin").index: program.t + h}
        up, down = rename([relay.up, relay.down], later)
        pull = make("maximum", make("maximum", up, -down), 0.0)
        return make("where", self._symbol(f"free{relay.place}") > 0.0, 0.0, h * pull)

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
    """What jumps where x passes zero, and how it follows from the sign of x: the sign itself, and
    comparisons with zero, x > 0."""
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
