"""The equations of a net: the flow between updates (ticks), and the updates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..expression.graph import Graph, Node, rename
from .equations import Program
from .instant import AlgebraicLoop, Rows, Unsolved, settled
from .network import Net
from .tracer import _Tracer, single
from .verify import check

Answer = Callable[[int, Sequence[Node]], list[Node]]


@dataclass(frozen=True, eq=False)
class Tick:
    """The sampled parts' states and held outputs after a tick: nodes of t, x, q, u, g, p.

    ``q`` are the states before it, ``g`` has one flag for each sample time: 1 a tick, 0.5 only
    its outputs, 0 nothing. Held values are inputs of the flow, after the external inputs.
    """

    q: tuple[Node, ...]
    g: tuple[Node, ...]
    new_q: tuple[Node, ...]
    new_h: tuple[Node, ...]


@dataclass(frozen=True, eq=False)
class Hybrid:
    """Flow and tick (None: not requested, or a system alone) of a net; one parameter vector.

    The outputs of the flow are all signals. They depend on t, x, u and, if the net reads earlier
    values, on the held values before the tick, ``b0``, ``b1``, ... ``blocks`` holds the traced
    blocks, each with its own equations.
    """

    net: Net
    flow: Program
    tick: Tick | None
    blocks: tuple[tuple[Program, Any], ...]

    @property
    def ticked(self) -> tuple[Node, ...]:
        """What a tick computes."""
        return self.tick.new_q + self.tick.new_h if self.tick else ()

    def check(self, params: Mapping[str, Any] | None, *scales: Sequence[float]) -> None:
        """Compare each block with its own equations: :func:`.verify.check`."""
        for program, block in self.blocks:
            check(program, block, params, *scales)

    def sharpened(self, params: Mapping[str, Any] | None) -> Hybrid:
        """The flow and the signals as :meth:`.equations.Program.sharpened`."""
        return replace(self, flow=self.flow.sharpened(params))

    def outline(self) -> tuple[Any, ...]:
        """The equations as a hashable value: :meth:`.equations.Program.outline`."""
        names = tuple((block.name, tuple(block.state_labels)) for _, block in self.blocks)
        tick = (self.tick.q, self.tick.g, self.tick.new_q, self.tick.new_h) if self.tick else ()
        return self.net.wiring, names, self.flow.outline(*tick)


def trace_net(net: Net, params: Mapping[str, Any] | None = None, *, ticks: bool = True) -> Hybrid:
    """The equations of a net; those of each block are checked against the block itself.

    Raises TraceError when a function cannot be traced, AlgebraicLoop when outputs depend on
    themselves. Without ``ticks`` the sampled parts are not traced.
    """
    hybrid = traced_net(net, params, ticks=ticks)
    hybrid.check(params)
    return hybrid


def traced_net(
    net: Net,
    params: Mapping[str, Any] | None = None,
    *,
    ticks: bool = True,
    exact: Sequence[int] = (),
) -> Hybrid:
    """As :func:`trace_net`, not yet checked.

    The continuous states ``exact`` of dead times are the delayed signals: :class:`.graph.Graph`.
    """
    for part in net.parts:
        part.block._update_params(params)
    if net.alone and not net.groups:
        system = net.parts[0].block
        program = single(system, exact)
        return Hybrid(net, program, None, ((program, system),))
    own = [part.block for part in net.parts if ticks or not part.sampled]
    blocks = tuple((single(block), block) for block in own)
    return _NetTracer(net, exact).hybrid(ticks, blocks)


class _NetTracer(_Tracer):
    """Symbols for a net and the walk through its parts."""

    def __init__(self, net: Net, exact: Sequence[int] = ()) -> None:
        self.net, self.graph = net, Graph()
        self.t = self.graph.symbol("t")
        self.x = self._symbols("x", net.count(False))
        self.graph.exact = frozenset(self.x[i].index for i in exact)
        self.q = self._symbols("q", net.count(True))
        self.g = self._symbols("g", net.groups)
        self.u = self._symbols("u", len(net.outside) + len(net.held))
        self.slots, self.fixed, self.values, self.answers = {}, {}, {}, {}
        for part in net.parts:
            self._collect(part.block)

    def hybrid(self, ticks: bool, blocks: tuple[tuple[Program, Any], ...]) -> Hybrid:
        inputs, outputs = self._settle(self._held_parts(), self._answer)
        xdot = [
            rate
            for i, part in enumerate(self.net.parts)
            if not part.sampled
            for rate in self._rates(part.block, self._own(i), inputs[i])
        ]
        tick = self._tick(outputs) if ticks else None
        y = self._signals_of(outputs)
        net, held = self.net, [self.net.parts[i].outputs[j] for i, j in self.net.held]
        labels = net.states(sampled=False), (*net.outside, *held), net.signals
        roots = [*xdot, *y, *(tick.new_q + tick.new_h if tick else ())]
        return Hybrid(net, self._named(net.name, labels, xdot, y, roots), tick, blocks)

    def _own(self, i: int) -> Sequence[Node]:
        return (self.q if self.net.parts[i].sampled else self.x)[self.net.places[i]]

    def _held_parts(self) -> list[list[Node] | None]:
        """The held outputs of the sampled parts, None for the others."""
        rows: list[list[Node] | None] = [[] if part.sampled else None for part in self.net.parts]
        values = self.u[len(self.net.outside) :]
        for (i, _), node in zip(self.net.held, values, strict=True):
            held = rows[i]
            assert held is not None
            held.append(node)
        return rows

    def _answer(self, i: int, inputs: Sequence[Node]) -> list[Node]:
        return self._outputs(self.net.parts[i].block, self._own(i), inputs)

    def _settle(
        self, fixed: Sequence[list[Node] | None], answer: Answer
    ) -> tuple[list[list[Node]], list[list[Node]]]:
        """Inputs and outputs of all parts at one instant; ``fixed`` outputs do not change."""
        parts = self.net.parts

        def inputs(rows: Rows) -> list[list[Node]]:
            return [[self._signal(label, rows) for label in part.inputs] for part in parts]

        def respond(rows: Rows) -> Rows:
            asked = zip(fixed, inputs(rows), strict=True)
            return [answer(i, given) if f is None else f for i, (f, given) in enumerate(asked)]

        try:
            counts = [len(part.outputs) for part in parts]
            outputs = settled(self.graph, counts, respond, self._numbers())
        except Unsolved as error:
            raise AlgebraicLoop(self.net.loop_message(error.blocks)) from None
        return inputs(outputs), outputs

    def _signal(self, label: str, outputs: Sequence[Sequence[Node]]) -> Node:
        """The sum of all outputs of a name, or the external input."""
        if label in self.net.outside:
            return self.u[self.net.outside.index(label)]
        return self.graph.total(outputs[i][j] for i, j in self.net.sources[label])

    def _tick(self, flowing: Sequence[list[Node]]) -> Tick:
        parts, still = self.net.parts, self._held_parts()

        def answer(i: int, inputs: Sequence[Node]) -> list[Node]:
            fresh, held = self._answer(i, inputs), still[i]
            return fresh if held is None else self._chosen(i, 0.25, fresh, held)

        earlier = [
            row if self.net.earlier and not part.sampled else None
            for part, row in zip(parts, flowing, strict=True)
        ]
        inputs, outputs = self._settle(earlier, answer)
        new_q = []
        for i, part in enumerate(parts):
            if part.sampled:
                own = self._own(i)
                new_q += self._chosen(i, 0.75, self._rates(part.block, own, inputs[i]), own)
        return Tick(self.q, self.g, tuple(new_q), tuple(outputs[i][j] for i, j in self.net.held))

    def _chosen(
        self, i: int, level: float, fresh: Sequence[Node], kept: Sequence[Node]
    ) -> list[Node]:
        """New values at a tick of the part's sample time, else the held ones."""
        flag = self.g[self.net.parts[i].group or 0] > level
        return [self.graph.make("where", flag, a, b) for a, b in zip(fresh, kept, strict=True)]

    def _signals_of(self, outputs: Sequence[Sequence[Node]]) -> list[Node]:
        if self.net.earlier:
            held = self.u[len(self.net.outside) :]
            before = {u.index: self.graph.symbol(f"b{k}") for k, u in enumerate(held)}
            outputs = [
                row if part.sampled else rename(row, before)
                for part, row in zip(self.net.parts, outputs, strict=True)
            ]
        return [
            self.graph.total(outputs[i][j] for i, j in self.net.sources[label])
            for label in self.net.signals
        ]
