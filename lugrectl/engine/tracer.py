"""Derives the equations of python-control systems by calling their own functions on symbols.

Each function runs once, with symbolic scalars for its signals and numeric parameters; anything else
that it reads has its value of now. What the blocks read of each other is put in afterwards. A net
has a flow between updates (ticks), and the updates; a system alone is a net of one part.
"""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from graphlib import TopologicalSorter
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.bare_system import BareSystem
from ..core.errors import InputError
from .graph import (
    Graph,
    Node,
    TraceError,
    affine,
    evaluate,
    outline,
    reachable,
    rename,
    sharp,
    signal_array,
    symbols_in,
)
from .rosenbrock import SparseLU

if TYPE_CHECKING:  # slow to import, and a block alone is traced without it
    import control as ct


def is_wired(system: Any) -> bool:
    """Whether a system is an interconnection."""
    return hasattr(system, "syslist")


def is_number(value: Any) -> bool:
    """Whether a parameter has a number as its value."""
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


@dataclass(frozen=True, eq=False)
class Part:
    """A block, its signals in the net, and the number of its sample time, None for none."""

    block: Any
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    group: int | None = None

    @classmethod
    def of(cls, block: Any, group: int | None = None) -> Part:
        """Return a block with its own names for its signals."""
        return cls(block, tuple(block.input_labels), tuple(block.output_labels), group)

    @property
    def sampled(self) -> bool:
        return self.group is not None

    @property
    def nstates(self) -> int:
        return int(self.block.nstates or 0)


@dataclass(frozen=True, eq=False)
class Net:
    """Parts, whose outputs of the same name are added, and the external signals.

    ``earlier``: at an update the sampled parts read the values of the others just before it.
    ``alone``: the net of one system, whose names it has.
    """

    name: str
    parts: tuple[Part, ...]
    outside: tuple[str, ...]
    groups: int
    earlier: bool = False
    alone: bool = False

    @classmethod
    def of(cls, system: Any, *, sampled: bool = True) -> Net:
        """Return the net of one system; without ``sampled`` a discrete one acts at any instant."""
        part = Part.of(system, 0 if sampled and system.isdtime(strict=True) else None)
        return cls(system.name, (part,), part.inputs, int(part.sampled), alone=True)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """All output names, each once."""
        if self.alone:
            return self.parts[0].outputs
        return tuple(dict.fromkeys(self._made))

    @cached_property
    def _made(self) -> list[str]:
        return [label for part in self.parts for label in part.outputs]

    def makers(self, label: str) -> str:
        """The names of the blocks that put out a signal."""
        return ", ".join(
            dict.fromkeys(part.block.name for part in self.parts if label in part.outputs)
        )

    @cached_property
    def entry(self) -> np.ndarray:
        """The inputs of all blocks from outside."""
        return _equal([label for part in self.parts for label in part.inputs], self.outside)

    @cached_property
    def connect(self) -> np.ndarray:
        """Their inputs as sums of all outputs; what comes from outside comes from there alone."""
        made = _equal([label for part in self.parts for label in part.inputs], self._made)
        return made * (self.entry.sum(axis=1, keepdims=True) == 0.0)

    @cached_property
    def gather(self) -> np.ndarray:
        """The signals as sums of all outputs."""
        return _equal(self.signals, self._made)

    @cached_property
    def held(self) -> list[tuple[int, int]]:
        """Part and output of each value that is held between updates."""
        sampled = [(i, part) for i, part in enumerate(self.parts) if part.sampled]
        return [(i, j) for i, part in sampled for j in range(len(part.outputs))]

    @cached_property
    def places(self) -> list[slice]:
        """Each part's states among those of the continuous or those of the sampled parts."""
        ends, slices = {True: 0, False: 0}, []
        for part in self.parts:
            begin = ends[part.sampled]
            ends[part.sampled] = begin + part.nstates
            slices.append(slice(begin, begin + part.nstates))
        return slices

    def states(self, *, sampled: bool | None = None) -> tuple[str, ...]:
        """``block_state``, of the continuous parts, the sampled ones, or all in their order."""
        own = [p for p in self.parts if p.nstates and sampled in (None, p.sampled)]
        return tuple(
            label if self.alone else f"{part.block.name}_{label}"
            for part in own
            for label in part.block.state_labels
        )

    @property
    def looped(self) -> bool:
        """Whether there are several blocks, which may feed each other back."""
        return len(self.parts) > 1 or any(is_wired(part.block) for part in self.parts)

    @property
    def wiring(self) -> tuple[Any, ...]:
        """All but the blocks themselves."""
        parts = tuple((part.inputs, part.outputs, part.group) for part in self.parts)
        return parts, self.outside, self.groups, self.earlier, self.alone, self.name

    def count(self, sampled: bool) -> int:
        """The number of states of the continuous or the sampled parts."""
        return sum(part.nstates for part in self.parts if part.sampled is sampled)


def _equal(rows: Sequence[str], columns: Sequence[str]) -> np.ndarray:
    """1 where two names are the same."""
    return np.array([[float(a == b) for b in columns] for a in rows]).reshape(
        len(rows), len(columns)
    )


@dataclass(frozen=True, eq=False)
class Program:
    """The equations of a system: xdot = f(t, x, u, p), y = g(t, x, u, p) as graph nodes.

    ``parameters`` are unique labels, ``keys`` their names in python-control, ``widths`` the values
    up to which each only smooths a sign. Those in ``fixed`` were needed as numbers.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    keys: tuple[str, ...]
    defaults: np.ndarray
    widths: tuple[float, ...]
    fixed: Mapping[str, Any]
    graph: Graph
    t: Node
    x: tuple[Node, ...]
    u: tuple[Node, ...]
    p: tuple[Node, ...]
    xdot: tuple[Node, ...]
    y: tuple[Node, ...]

    def outline(self, *more: tuple[Node, ...]) -> tuple[Any, ...]:
        """The equations and other nodes as a hashable value: all but the defaults of parameters."""
        names = (self.name, self.states, self.inputs, self.outputs, self.parameters, self.keys)
        return *names, outline([(self.t,), self.x, self.u, self.p, self.xdot, self.y, *more])

    def sharpened(
        self, params: Mapping[str, Any] | None = None, *, of: Sequence[Node] | None = None
    ) -> Program:
        """The program with sign(x) for tanh(x/p) of ``of``, None: any, where p only smooths it."""
        rows = zip(self.p, self.widths, self.arguments(params), strict=True)
        narrow = [node for node, width, value in rows if 0.0 < value <= width]
        if not narrow:
            return self
        roots, n = sharp([*self.xdot, *self.y], narrow, of), len(self.x)
        return replace(self, xdot=tuple(roots[:n]), y=tuple(roots[n:]))

    def values(self, t: Any, x: Any, u: Any, p: Any | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(xdot, y) by interpretation; x (n, ...), u (m, ...), p (q, ...) may be batches."""
        numbers = [t, *x, *u, *(self.defaults if p is None else p)]
        symbols = [self.t, *self.x, *self.u, *self.p]
        known = {node.value: v for node, v in zip(symbols, numbers, strict=True)}
        shape = np.broadcast_shapes(*(np.shape(v) for v in known.values()))
        rows = [np.broadcast_to(v, shape) for v in evaluate(self.xdot + self.y, known)]
        rows = np.array(rows, dtype=float).reshape(-1, *shape)
        return rows[: len(self.x)], rows[len(self.x) :]

    def arguments(self, params: Mapping[str, Any] | None) -> np.ndarray:
        """The parameter vector with ``params`` in place of defaults."""
        params = params or {}
        pairs = zip(self.keys, self.defaults, strict=True)
        return np.array([float(params.get(k, v)) for k, v in pairs])


class AlgebraicLoop(InputError):
    """Outputs that depend on themselves without a state in between, and cannot be solved."""


TRIED = 0.7310585786300049  # in place of a symbol that is no parameter, where a divisor is tried
LEAST = 1e-12  # a divisor below this counts as zero

AGAIN = (1.0, 30.0)  # for equations that were checked at all scales before
NEAR = 1e-11  # of the arguments: how far rounding may move them
POSITIVE = (1.0, 1e2, 1e4)  # where no other point gives a value: a root or a logarithm


class Differs(TraceError):
    """A trace does not give what the system itself gives."""


def check(program: Program, block: Any, scales: Sequence[float] = (1.0, 1e-3, 30.0, 0.1)) -> None:
    """Compare the trace of a block with its own functions at random points of these sizes;
    TraceError where they differ."""
    random, current = np.random.default_rng(len(program.graph.nodes)), dict(block._current_params)
    spread = np.array([0.0 if k in program.fixed else 0.2 for k in program.keys])[:, None]
    for sizes, signed in ((scales, True), (POSITIVE, False)):
        size, many, compared = np.array(sizes), len(sizes), 0
        x, u = (size * random.standard_normal((len(of), many)) for of in (program.x, program.u))
        x, u = (v if signed else np.abs(v) for v in (x, u))
        moved = (size != 1.0) * spread * random.uniform(-1, 1, (len(spread), many))
        t, p = np.abs(size * random.standard_normal(many)), program.defaults[:, None] * (1 + moved)
        every = np.concatenate(program.values(t, x, u, p))
        for i, ours in enumerate(every.T):
            point = t[i], x[:, i], u[:, i], p[:, i]
            pairs = zip(program.keys, point[3], strict=True)
            free = {k: v for k, v in pairs if k not in program.fixed}
            block._update_params({**current, **free})
            try:
                with np.errstate(all="ignore"):
                    own = np.concatenate([block._rhs(*point[:3]), block._out(*point[:3])])
            except (ArithmeticError, ValueError, RuntimeError):
                continue
            finally:
                block._update_params(current)
            compared += _compare(program, own, ours, point)
        if compared or not program.xdot + program.y:
            return
    raise TraceError(f"{program.name}: gives no finite value at any point that was tried")


def _compare(program: Program, own: np.ndarray, ours: np.ndarray, at: Sequence[Any]) -> bool:
    """Whether the point is usable: some value is finite."""
    bad = ~np.isclose(ours, own, rtol=1e-9, atol=0.0, equal_nan=True)
    if np.any(bad):
        slack, random = np.full(len(ours), 1e-300), np.random.default_rng(0)
        for _ in range(4):  # what rounding may change of each value, where large terms cancel
            t, x, u, p = (a * (1 + NEAR * random.choice([-1.0, 1.0], np.shape(a))) for a in at)
            with np.errstate(all="ignore"):
                moved = np.concatenate(program.values(t, x, u, p))
                slack = np.fmax(slack, 10 * np.abs(moved - ours))
        bad = ~np.isclose(ours, own, rtol=1e-9, atol=slack, equal_nan=True)
    if np.any(bad):
        label = (program.states + program.outputs)[int(np.flatnonzero(bad)[0])]
        raise Differs(
            f"{program.name}: the traced equation of {label} differs from the system's own "
            "(does a block keep values between calls, or draw random numbers?)"
        )
    return bool(np.any(np.isfinite(own)))


@dataclass(frozen=True, eq=False)
class Hybrid:
    """Flow and updates (ticks) of a net.

    The outputs of the flow are all signals; its last inputs are the held values, ``b0``, ... those
    before a tick. A tick gives the sampled states ``new_q`` and held values ``new_h`` from t, x, u,
    the states ``q`` before it, and a flag ``g0``, ... for each sample time: 1 a tick, 0.5 only its
    outputs. ``blocks`` are all blocks, on all levels, with the trace of each alone; ``at`` is what
    their inputs read.
    """

    net: Net
    flow: Program
    q: tuple[Node, ...]
    new_q: tuple[Node, ...]
    new_h: tuple[Node, ...]
    blocks: list[tuple[Any, Program]]
    at: dict[int, Node]

    @property
    def ticked(self) -> tuple[Node, ...]:
        """What a tick computes."""
        return self.new_q + self.new_h

    def check(self, *scales: Sequence[float]) -> None:
        """Compare the trace of each block with its own functions, with the parameters now set."""
        for block, program in self.blocks:
            check(program, block, *scales)

    def sharpened(self, params: Mapping[str, Any] | None) -> Hybrid:
        """The same with the flow as :meth:`Program.sharpened`."""
        return replace(self, flow=self.flow.sharpened(params))

    def outline(self) -> tuple[Any, ...]:
        """The equations as a hashable value, as :meth:`Program.outline`."""
        blocks = [part.block for part in self.net.parts]
        names = tuple((block.name, tuple(block.state_labels)) for block in blocks)
        return self.net.wiring, names, self.flow.outline(self.q, self.new_q, self.new_h)

    def culprit(self, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> str:
        """The first output of a block that is not finite: "output y of block b is nan"."""
        symbols = [self.flow.t, *self.flow.x, *self.flow.u, *self.flow.p]
        known = {node.value: v for node, v in zip(symbols, [t, *x, *u, *p], strict=True)}
        found = [
            (node.index, f"output {label} of block {block.name}", node)
            for block, program in self.blocks
            for label, node in zip(program.outputs, rename(program.y, self.at), strict=True)
        ]
        _, labels, nodes = zip(*sorted(found, key=lambda row: row[0]), strict=True)
        pairs = zip(labels, map(float, evaluate(nodes, known)), strict=True)
        return next(f"{k} is {v}" for k, v in pairs if not np.isfinite(v))


def trace(
    system: ct.NonlinearIOSystem | BareSystem, params: Mapping[str, Any] | None = None
) -> Program:
    """The equations of a continuous system, checked against the system itself."""
    if system.isdtime(strict=True):
        raise InputError(f"{system.name} is a discrete-time system; the engine needs dt = 0.")
    if None in (system.nstates, system.ninputs, system.noutputs):
        raise InputError(f"{system.name}: give its inputs=, outputs= and states= in ct.nlsys.")
    hybrid = traced_net(Net.of(system), params)
    hybrid.check()
    return hybrid.flow


def single(system: Any) -> Program:
    """The equations of any system, with the parameters that are set, not yet checked."""
    return _Tracer(Net.of(system, sampled=False)).hybrid(False).flow


def traced_net(
    net: Net,
    params: Mapping[str, Any] | None = None,
    *,
    ticks: bool = True,
    exact: Sequence[int] = (),
    called: bool = False,
) -> Hybrid:
    """The equations of a net, not yet checked: :meth:`Hybrid.check`. The states ``exact`` are
    delayed signals. With ``called`` all update functions, and the output functions that cannot be
    traced, are called as they are."""
    for part in net.parts:
        part.block._update_params(params)
    return _Tracer(net, exact, called).hybrid(ticks and net.groups > 0)


@dataclass
class _Slot:
    """A parameter of one or more blocks that have the same key and value."""

    key: str
    value: float
    node: Node
    width: float = 0.0
    users: list[str] = field(default_factory=list)

    def label(self, keys: Sequence[str]) -> str:
        return self.key if keys.count(self.key) == 1 else f"{self.users[0]}:{self.key}"


class _Tracer:
    """The walk through the blocks of a net: each function is called once, with symbols for the
    block's own inputs; ``read`` says what each of them stands for."""

    def __init__(self, net: Net, exact: Sequence[int] = (), called: bool = False) -> None:
        self.net, self.graph, self.called = net, Graph(), called
        self.t = self.graph.symbol("t")
        self.x = self._symbols("x", net.count(False))
        self.graph.exact = frozenset(self.x[i].index for i in exact)
        self.q = self._symbols("q", net.count(True))
        self.g = self._symbols("g", net.groups)
        self.u = self._symbols("u", len(net.outside) + len(net.held))
        self.slots: dict[tuple[str, float], _Slot] = {}
        self.fixed: dict[str, Any] = {}
        self.values: dict[int, dict[str, Any]] = {}
        self.read: dict[int, Node] = {}
        self.readers: dict[int, str] = {}
        self.blocks: list[tuple[Any, Program]] = []
        for part in net.parts:
            blocks = list(blocks_in(part.block))
            self.values |= {id(block): dict(block._current_params) for block in blocks}
            for own in (True, False):  # the blocks' own keys first: overrides change no order
                for block in blocks:
                    keys = [k for k in block._current_params if (k in block.params) is own]
                    self.values[id(block)] |= {k: self._symbol(block, k) for k in keys}

    def _symbols(self, letter: str, count: int) -> tuple[Node, ...]:
        return tuple(self.graph.symbol(f"{letter}{i}") for i in range(count))

    def _symbol(self, block: Any, key: str) -> Any:
        """The symbol of a numeric parameter: blocks with equal key and value share it."""
        value = block._current_params[key]
        if not is_number(value):
            return value
        node = self.graph.symbol(f"p{len(self.slots)}")
        width = widths(block).get(key, 0.0)
        slot = self.slots.setdefault((key, float(value)), _Slot(key, float(value), node, width))
        slot.users.append(block.name)
        return slot.node

    def hybrid(self, ticks: bool) -> Hybrid:
        net, values = self.net, iter(self.u[len(self.net.outside) :])
        self.given = [self._inputs(part.block) for part in net.parts]
        self.held = [[next(values) for _ in p.outputs] if p.sampled else None for p in net.parts]
        none = list[Node](), list[Node]()
        found = [
            self._follow(part.block, self._own(i), self.given[i])
            if ticks or not part.sampled
            else none
            for i, part in enumerate(net.parts)
        ]
        rates, outputs = [row for row, _ in found], [row for _, row in found]
        shown = [still or row for row, still in zip(outputs, self.held, strict=True)]
        at = self._settled(shown)
        flowing = [rename(row, at) for row in shown]
        moving = (row for part, row in zip(net.parts, rates, strict=True) if not part.sampled)
        xdot = rename([*chain(*moving)], at)
        new_q, new_h = self._tick(rates, outputs, flowing) if ticks else ((), ())
        if net.earlier:
            held = self.u[len(net.outside) :]
            before = {u.index: self.graph.symbol(f"b{k}") for k, u in enumerate(held)}
            pairs = zip(net.parts, flowing, strict=True)
            flowing = [row if part.sampled else rename(row, before) for part, row in pairs]
        y = self._linear(net.gather, [*chain(*flowing)])
        seen = symbols_in([*xdot, *y, *new_q, *new_h])
        slots = [s for s in self.slots.values() if s.key not in self.fixed or s.node.value in seen]
        inputs = (*net.outside, *(net.parts[i].outputs[j] for i, j in net.held))
        labels = net.name, net.states(sampled=False), inputs, net.signals
        flow = self._program(labels, self.x, self.u, xdot, y, slots)
        return Hybrid(net, flow, self.q if ticks else (), new_q, new_h, self.blocks, at)

    def _own(self, i: int) -> Sequence[Node]:
        return (self.q if self.net.parts[i].sampled else self.x)[self.net.places[i]]

    def _tick(
        self, rates: Sequence[list[Node]], outputs: Sequence[list[Node]], flowing: Any
    ) -> tuple[tuple[Node, ...], tuple[Node, ...]]:
        """The sampled states and the held values after a tick."""
        net = self.net
        fresh = [
            (flowing[i] if net.earlier else outputs[i])
            if still is None
            else self._chosen(i, 0.25, outputs[i], still)
            for i, still in enumerate(self.held)
        ]
        at = self._settled(fresh)
        new_q = [
            q
            for i, part in enumerate(net.parts)
            if part.sampled
            for q in self._chosen(i, 0.75, rename(rates[i], at), self._own(i))
        ]
        return tuple(new_q), tuple(rename([fresh[i][j] for i, j in net.held], at))

    def _program(
        self,
        labels: tuple[str, Sequence[str], Sequence[str], Sequence[str]],
        x: Sequence[Node],
        u: Sequence[Node],
        xdot: Sequence[Node],
        y: Sequence[Node],
        slots: Sequence[_Slot],
    ) -> Program:
        """The program of equations, with the parameters that did not enter them as numbers."""
        name, *rows = labels
        keys = [slot.key for slot in slots]
        return Program(
            name,
            *map(tuple, rows),
            parameters=tuple(slot.label(keys) for slot in slots),
            keys=tuple(keys),
            defaults=np.array([slot.value for slot in slots]),
            widths=tuple(slot.width for slot in slots),
            fixed=self.fixed,
            graph=self.graph,
            t=self.t,
            x=tuple(x),
            u=tuple(u),
            p=tuple(slot.node for slot in slots),
            xdot=tuple(xdot),
            y=tuple(y),
        )

    def _inputs(self, block: Any) -> tuple[Node, ...]:
        """Symbols for the inputs of a block."""
        begin = len(self.readers)
        made = tuple(self.graph.symbol(f"i{begin + j}") for j in range(block.ninputs))
        self.readers |= {v.index: block.name for v in made}
        return made

    def _follow(
        self, system: Any, x: Sequence[Node], v: Sequence[Node]
    ) -> tuple[list[Node], list[Node]]:
        """Rates and outputs of a system, on all its levels, in terms of the blocks' inputs."""
        if not is_wired(system):
            outputs, rates = list(x[: system.noutputs]), list[Node]()
            if system.outfcn is not None:
                outputs = self._call(system, system.outfcn, x, v, system.noutputs)
            if system.nstates:
                rates = self._call(system, system.updfcn, x, v, system.nstates)
            names = system.state_labels or (), system.input_labels, system.output_labels
            own = {n.index for n in self.values[id(system)].values() if isinstance(n, Node)}
            slots = [slot for slot in self.slots.values() if slot.node.index in own]
            alone = self._program((system.name, *names), x, v, rates, outputs, slots)
            self.blocks.append((system, alone))
            return rates, outputs
        rates, outputs, given, states = list[Node](), list[Node](), list[Node](), iter(x)
        for block in system.syslist:
            own = [next(states) for _ in range(block.nstates or 0)]
            inputs = self._inputs(block)
            found = self._follow(block, own, inputs)
            rates, outputs, given = rates + found[0], outputs + found[1], [*given, *inputs]
        fed, outside = self._linear(system.connect_map, outputs), self._linear(system.input_map, v)
        self.read |= {g.index: a + b for g, a, b in zip(given, fed, outside, strict=True)}
        return rates, self._linear(system.output_map, [*outputs, *given])

    def _chosen(
        self, i: int, level: float, fresh: Sequence[Node], kept: Sequence[Node]
    ) -> list[Node]:
        """New values at a tick of the part's sample time, else the held ones."""
        flag = self.g[self.net.parts[i].group or 0] > level
        return [self.graph.make("where", flag, a, b) for a, b in zip(fresh, kept, strict=True)]

    def _settled(self, outputs: Sequence[Sequence[Node]]) -> dict[int, Node]:
        """The input of each block at one instant, for outputs that may depend on inputs: each
        single signal after those that it depends on."""
        net, at = self.net, dict[int, Node]()
        fed = self._linear(net.connect, [*chain(*outputs)])
        outside = self._linear(net.entry, self.u[: len(net.outside)])
        rows = zip(chain(*self.given), fed, outside, strict=True)
        read = self.read | {v.index: a + b for v, a, b in rows}
        needs = _needs(read)
        if solved := self._solved(read, needs):
            read |= solved
            needs = _needs(read)
        for k in TopologicalSorter(needs).static_order():
            (at[k],) = rename([read[k]], {j: at[j] for j in needs[k]})
        return at

    def _solved(self, read: Mapping[int, Node], left: dict[int, set[int]]) -> dict[int, Node]:
        """The inputs that depend on themselves, from equations that are linear in them."""
        while outer := left.keys() - set().union(*(own & left.keys() for own in left.values())):
            left = {k: own for k, own in left.items() if k not in outer}  # nothing depends on them
        while outer := [k for k, own in left.items() if not own & left.keys()]:
            left = {k: own for k, own in left.items() if k not in outer}
        if not left:
            return {}
        through, zero = dict.fromkeys(self.readers[k] for k in sorted(left)), self.graph.constant(0)
        symbols = [self.graph.nodes[k] for k in left]
        forms = [form for form in affine([read[k] for k in left], symbols) if form is not None]
        if len(forms) == len(left):
            rows = [[float(i is k) - f.slopes.get(k.index, zero) for k in symbols]
                    for i, f in zip(symbols, forms, strict=True)]  # fmt: skip
            with contextlib.suppress(KeyError):  # a pivot of 0
                lu = SparseLU(self.graph, rows)
                pivots = [lu.upper[i, i] for i in range(len(rows))]
                known = {slot.node.value: slot.value for slot in self.slots.values()}
                sizes = evaluate(pivots, {k: known.get(k, TRIED) for k in symbols_in(pivots)})
                if all(abs(size) > LEAST for size in sizes):
                    solved = lu.solve([form.offset for form in forms])
                    return dict(zip(left, solved, strict=True))
        raise AlgebraicLoop(
            f"{self.net.name}: algebraic loop through {', '.join(through)}; each output depends on "
            "itself at the same instant, and not by linear equations with one solution: put a "
            "state (a lag, a sensor) or a sample of delay between them."
        )

    def _linear(self, matrix: Any, nodes: Sequence[Node]) -> list[Node]:
        rows = np.atleast_2d(np.asarray(matrix, dtype=float))
        return [
            self.graph.total(gain * node for gain, node in zip(row, nodes, strict=True) if gain)
            for row in rows
        ]

    def _call(
        self, block: Any, function: Callable[..., Any], x: Any, u: Any, size: int
    ) -> list[Node]:
        """One block's function on symbols; counts are given as numbers."""
        if not (self.called and function is block.updfcn):
            try:
                return self._followed(block, function, x, u, size)
            except TraceError:
                if not self.called:
                    raise
        return self._as_it_is(block, function, x, u, size)

    def _followed(self, block: Any, function: Any, x: Any, u: Any, size: int) -> list[Node]:
        signals = signal_array(list(x)), signal_array(list(u))
        try:
            result = function(self.t, *signals, self.values[id(block)])
        except Exception:
            result = self._with_numbers(block, function, signals)
        flat = np.asarray(result, dtype=object).reshape(-1)
        if len(flat) != size:
            raise InputError(f"{block.name} returned {len(flat)} values but declares {size}.")
        return [v if isinstance(v, Node) else self.graph.constant(v) for v in flat]

    def _as_it_is(self, block: Any, function: Any, x: Any, u: Any, size: int) -> list[Node]:
        """A function that is called; an input that its outputs do not depend on is nan there."""
        params, n = dict(block._current_params), len(x)

        def answer(t: float, *signals: float) -> list[float]:
            values = function(t, np.array(signals[:n]), np.array(signals[n:]), params)
            flat = np.reshape(np.asarray(values, dtype=float), -1)
            if len(flat) != size:
                raise InputError(f"{block.name} returned {len(flat)} values but declares {size}.")
            return flat.tolist()

        given, nan = list(u), self.graph.constant(np.nan)
        if function is not block.updfcn:
            given = [v if _reads(answer, n, len(u), j) else nan for j, v in enumerate(u)]
        call = self.graph.call(answer, [self.t, *x, *given])
        return [self.graph.result(call, i) for i in range(size)]

    def _with_numbers(self, block: Any, function: Callable[..., Any], signals: Any) -> Any:
        """The result with as few parameters as possible as numbers: a count fixes itself alone."""
        known, numbers = self.values[id(block)], block._current_params
        try:
            result = function(self.t, *signals, dict(numbers))
        except Exception as error:
            frames = traceback.extract_tb(error.__traceback__)
            file = getattr(getattr(function, "__code__", None), "co_filename", None)
            own = [f for f in frames if f.filename == file]
            place = f", {own[-1].filename} line {own[-1].lineno}" if own else ""
            kind = "" if isinstance(error, TraceError) else f"{type(error).__name__}: "
            raise TraceError(f"block {block.name}{place}: {kind}{error}") from error
        needed = dict(numbers)
        for key in [k for k, v in numbers.items() if known[k] is not v]:
            try:
                result = function(self.t, *signals, needed | {key: known[key]})
                needed[key] = known[key]
            except Exception:
                self.fixed[key] = numbers[key]
        known.update(needed)
        return result


def _needs(read: Mapping[int, Node]) -> dict[int, set[int]]:
    """The inputs on which each input depends."""
    return {k: {n.index for n in reachable([node])} & {*read} for k, node in read.items()}


PROBES = (0.0, 1.0, -1.0, 2.0, 3.0, 1e-3, -1e-3, 30.0, -30.0, 1e6, -1e6)


def _reads(answer: Callable[..., list[float]], n: int, m: int, j: int) -> bool:
    """Whether what a function returns changes with its input j, at any of some points."""
    random, seen = np.random.default_rng(0), False
    for size in (0.3, 1.0, 3.0, 30.0):
        point, found = size * random.standard_normal(1 + n + m), set[Any]()
        point = np.abs(point) if size > 1.0 else point
        for value in PROBES:
            point[1 + n + j] = value
            try:
                with np.errstate(all="ignore"):
                    found.add(np.array(answer(*point.tolist())).tobytes())
            except Exception as error:
                found.add(str(error))
        if len(found) > 1:
            return True
        seen |= any(isinstance(one, bytes) for one in found)
    return not seen


def blocks_in(system: Any) -> Iterator[Any]:
    """The blocks, on all levels, that have functions of their own."""
    for block in system.syslist if is_wired(system) else ():
        yield from blocks_in(block)
    if not is_wired(system):
        yield system


def widths(system: Any) -> dict[str, float]:
    """The largest widths, by key, that only smooth a sign for solvers."""
    return {k: v for b in blocks_in(system) for k, v in getattr(b.outfcn, "widths", {}).items()}


def smooth_keys(system: Any) -> frozenset[str]:
    """The keys of widths, as they are set, that are too large to stand for a sign."""
    return frozenset(
        key
        for block in blocks_in(system)
        for key, width in getattr(block.outfcn, "widths", {}).items()
        if block._current_params[key] > width
    )
