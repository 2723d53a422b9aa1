"""Derives the equations of a python-control system by calling its own functions on symbols.

The blocks' update and output functions run once, through python-control's own connections, with
symbolic scalars in place of numbers. Numeric parameters remain arguments; anything else that a
function reads has its value at the time of tracing. Every trace is compared with the system
itself before it is returned.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.bare_system import BareSystem
from ...core.errors import InputError
from ..expression.graph import Graph, Node, symbols_in
from ..expression.numpy_protocol import TraceError, signal_array
from .equations import Program
from .instant import AlgebraicLoop, Rows, Unsolved, loop_message, settled
from .verify import check

if TYPE_CHECKING:  # slow to import, and a block alone is traced without it
    import control as ct


def trace(
    system: ct.NonlinearIOSystem | BareSystem, params: Mapping[str, Any] | None = None
) -> Program:
    """The equations of a continuous system, checked against the system itself.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        A block or an interconnection, nested or not.
    params : dict, optional
        Parameters as for ``control.input_output_response``.

    Raises
    ------
    TraceError
        When a function branches on a signal, uses ``math``, or otherwise cannot be traced.
    AlgebraicLoop
        When outputs depend on themselves; the message names the blocks.
    InputError
        For a discrete-time system.
    """
    program = traced(system, params)
    check(program, system, params)
    return program


def traced(
    system: ct.NonlinearIOSystem | BareSystem, params: Mapping[str, Any] | None = None
) -> Program:
    """As :func:`trace`, not yet checked."""
    if system.isdtime(strict=True):
        raise InputError(f"{system.name} is a discrete-time system; the engine needs dt = 0.")
    if None in (system.nstates, system.ninputs, system.noutputs):
        raise InputError(f"{system.name}: give its inputs=, outputs= and states= in ct.nlsys.")
    system._update_params(params)
    return single(system)


def single(system: ct.NonlinearIOSystem | BareSystem, exact: Sequence[int] = ()) -> Program:
    """As :func:`traced`, in continuous or discrete time, with the parameters that are set.

    The states ``exact`` of dead times are the delayed signals themselves: :class:`.graph.Graph`.
    """
    return _Tracer(system, exact).program()


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
    """Symbols for one system and the walk through its blocks."""

    def __init__(
        self, system: ct.NonlinearIOSystem | BareSystem, exact: Sequence[int] = ()
    ) -> None:
        self.system, self.graph = system, Graph()
        self.t = self.graph.symbol("t")
        self.x = self._symbols("x", system.nstates)
        self.graph.exact = frozenset(self.x[i].index for i in exact)
        self.u = self._symbols("u", system.ninputs)
        self.slots: dict[tuple[str, float], _Slot] = {}
        self.fixed: dict[str, Any] = {}
        self.values: dict[int, dict[str, Any]] = {}
        self.answers: dict[Any, list[Node]] = {}
        self._collect(system)

    def _symbols(self, letter: str, count: Any) -> tuple[Node, ...]:
        return tuple(self.graph.symbol(f"{letter}{i}") for i in range(count))

    def _collect(self, system: Any) -> None:
        """One symbol for each numeric parameter: blocks with equal key and value share it."""
        blocks = list(_blocks(system))
        for block in blocks:
            self.values[id(block)] = dict(block._current_params)
        for own in (True, False):  # the blocks' own keys first: overrides do not change the order
            for block in blocks:
                keys = [k for k in block._current_params if (k in block.params) is own]
                self.values[id(block)] |= {k: self._symbol(block, k) for k in keys}

    def _symbol(self, block: Any, key: str) -> Any:
        value = block._current_params[key]
        if not isinstance(value, (int, float, np.number)) or isinstance(value, bool):
            return value
        node = self.graph.symbol(f"p{len(self.slots)}")
        width = widths(block).get(key, 0.0)
        slot = self.slots.setdefault((key, float(value)), _Slot(key, float(value), node, width))
        slot.users.append(block.name)
        return slot.node

    def _free_slots(self, roots: Sequence[Node]) -> list[_Slot]:
        """All parameters except those that entered the equations as numbers."""
        seen = symbols_in(roots)
        return [s for s in self.slots.values() if s.key not in self.fixed or s.node.value in seen]

    def program(self) -> Program:
        system = self.system
        xdot = self._rates(system, self.x, self.u)
        y = self._outputs(system, self.x, self.u)
        labels = system.state_labels, system.input_labels, system.output_labels
        return self._named(system.name, labels, xdot, y, xdot + y)

    def _named(
        self,
        name: str,
        labels: Sequence[Sequence[str]],
        xdot: Sequence[Node],
        y: Sequence[Node],
        roots: Sequence[Node],
    ) -> Program:
        """The program of these equations; ``labels`` of states, inputs and outputs."""
        slots = self._free_slots(roots)
        keys = [slot.key for slot in slots]
        states, inputs, outputs = map(tuple, labels)
        return Program(
            name=name,
            states=states,
            inputs=inputs,
            outputs=outputs,
            parameters=tuple(slot.label(keys) for slot in slots),
            keys=tuple(keys),
            defaults=np.array([slot.value for slot in slots]),
            widths=tuple(slot.width for slot in slots),
            fixed=self.fixed,
            graph=self.graph,
            t=self.t,
            x=self.x,
            u=self.u,
            p=tuple(slot.node for slot in slots),
            xdot=tuple(xdot),
            y=tuple(y),
        )

    def _rates(self, system: Any, x: Sequence[Node], u: Sequence[Node]) -> list[Node]:
        if not system.nstates:
            return []
        if not is_wired(system):
            return self._call(system, system.updfcn, x, u, system.nstates)
        inputs, _ = self._signals(system, x, u)
        return [
            rate
            for block, own, held in _parts(system, x, inputs)
            for rate in self._rates(block, own, held)
        ]

    def _outputs(self, system: Any, x: Sequence[Node], u: Sequence[Node]) -> list[Node]:
        if is_wired(system):
            inputs, outputs = self._signals(system, x, u)
            return self._linear(system.output_map, outputs + inputs)
        if system.outfcn is None:
            return list(x[: system.noutputs])
        return self._call(system, system.outfcn, x, u, system.noutputs)

    def _signals(
        self, system: Any, x: Sequence[Node], u: Sequence[Node]
    ) -> tuple[list[Node], list[Node]]:
        """Inputs and outputs of all blocks of an interconnection."""
        external = self._linear(system.input_map, u)

        def inputs(rows: Rows) -> list[Node]:
            fed = self._linear(system.connect_map, [y for row in rows for y in row])
            return [a + b for a, b in zip(fed, external, strict=True)]

        def respond(rows: Rows) -> Rows:
            parts = _parts(system, x, inputs(rows))
            return [self._outputs(block, own, held) for block, own, held in parts]

        try:
            counts = [block.noutputs for block in system.syslist]
            rows = settled(self.graph, counts, respond, self._numbers())
        except Unsolved as error:
            names = ", ".join(system.syslist[i].name for i in error.blocks)
            raise AlgebraicLoop(loop_message(system.name, names)) from None
        return inputs(rows), [y for row in rows for y in row]

    def _numbers(self) -> dict[str, float]:
        """The values of the parameters by symbol."""
        return {slot.node.value: slot.value for slot in self.slots.values()}

    def _linear(self, matrix: Any, nodes: Sequence[Node]) -> list[Node]:
        rows = np.atleast_2d(np.asarray(matrix, dtype=float))
        return [
            self.graph.total(gain * node for gain, node in zip(row, nodes, strict=True) if gain)
            for row in rows
        ]

    def _call(
        self, block: Any, function: Callable[..., Any], x: Any, u: Any, size: int
    ) -> list[Node]:
        """One block's function on symbols; parameters needed as numbers are given as numbers.

        Called once for each set of inputs: the passes through a system repeat the same calls.
        """
        asked = (id(block), id(function), size, *(n.index for n in (*x, *u)))
        if asked not in self.answers:
            self.answers[asked] = self._asked(block, function, x, u, size)
        return self.answers[asked]

    def _asked(
        self, block: Any, function: Callable[..., Any], x: Any, u: Any, size: int
    ) -> list[Node]:
        signals = signal_array(list(x)), signal_array(list(u))
        known = self.values[id(block)]
        try:
            result = function(self.t, *signals, known)
        except Exception:
            result = self._with_numbers(block, function, signals)
        return self._nodes(block, result, size)

    def _with_numbers(self, block: Any, function: Callable[..., Any], signals: Any) -> Any:
        """The result with as few parameters as possible as numbers: a count fixes itself alone."""
        known, numbers = self.values[id(block)], block._current_params
        try:
            result = function(self.t, *signals, dict(numbers))
        except Exception as error:
            raise TraceError(_blame(block, function, error)) from error
        needed = dict(numbers)
        for key in [k for k, v in numbers.items() if known[k] is not v]:
            try:
                result = function(self.t, *signals, needed | {key: known[key]})
                needed[key] = known[key]
            except Exception:
                self.fixed[key] = numbers[key]
        known.update(needed)
        return result

    def _nodes(self, block: Any, result: Any, size: int) -> list[Node]:
        flat = np.asarray(result, dtype=object).reshape(-1)
        if len(flat) != size:
            raise InputError(f"{block.name} returned {len(flat)} values but declares {size}.")
        return [v if isinstance(v, Node) else self.graph.constant(v) for v in flat]


def is_wired(system: Any) -> bool:
    """Whether a system is an interconnection."""
    return hasattr(system, "syslist")


def _blocks(system: Any) -> Iterator[Any]:
    """The blocks, on all levels, that have functions of their own."""
    if not is_wired(system):
        yield system
        return
    for block in system.syslist:
        yield from _blocks(block)


def widths(system: Any) -> dict[str, float]:
    """The largest widths, by key, that only smooth a sign for solvers."""
    return {k: v for b in _blocks(system) for k, v in getattr(b.outfcn, "widths", {}).items()}


def smooth_keys(system: Any) -> frozenset[str]:
    """The keys of widths, as they are set, that are too large to stand for a sign."""
    return frozenset(
        key
        for block in _blocks(system)
        for key, width in widths(block).items()
        if block._current_params[key] > width
    )


def _parts(system: Any, x: Sequence[Node], u: Sequence[Node]) -> list[tuple[Any, Any, Any]]:
    """Each block with its states and inputs, in python-control's order."""
    parts, first, entry = [], 0, 0
    for block in system.syslist:
        own, held = x[first : first + block.nstates], u[entry : entry + block.ninputs]
        parts.append((block, own, held))
        first, entry = first + block.nstates, entry + block.ninputs
    return parts


def _blame(block: Any, function: Callable[..., Any], error: Exception) -> str:
    """A message with the block, the line and the reason."""
    frames = traceback.extract_tb(error.__traceback__)
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    own = [f for f in frames if f.filename == file]
    place = f", {own[-1].filename} line {own[-1].lineno}" if own else ""
    kind = "" if isinstance(error, TraceError) else f"{type(error).__name__}: "
    return f"block {block.name}{place}: {kind}{error}"
