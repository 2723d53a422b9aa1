"""Continuous and sampled blocks, connected by matrices of their signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .instant import AlgebraicLoop, by_block


def is_wired(system: Any) -> bool:
    """Whether a system is an interconnection."""
    return hasattr(system, "syslist")


@dataclass(frozen=True, eq=False)
class Wires:
    """Blocks whose inputs are v = connect y + entry u, from their outputs y and from outside."""

    name: str
    blocks: Sequence[Any]
    connect: np.ndarray
    entry: np.ndarray

    @classmethod
    def inside(cls, system: Any) -> Wires:
        """Return the wires of an interconnection."""
        maps = [np.asarray(m, dtype=float) for m in (system.connect_map, system.input_map)]
        return cls(system.name, system.syslist, *map(np.atleast_2d, maps))

    def split(self, kind: str, flat: Any) -> list[Any]:
        """Return the part of each block in a row of all "inputs", "outputs" or "states"."""
        return by_block([int(getattr(b, f"n{kind}") or 0) for b in self.blocks], flat)

    @cached_property
    def inputs(self) -> list[slice]:
        """The place of each block's inputs among all."""
        return [slice(r.start, r.stop) for r in self.split("inputs", range(len(self.connect)))]

    @cached_property
    def outputs(self) -> list[slice]:
        """The place of each block's outputs among all."""
        places = self.split("outputs", range(self.connect.shape[1]))
        return [slice(r.start, r.stop) for r in places]

    def loop(self, members: Sequence[int]) -> AlgebraicLoop:
        """Return the error on an algebraic loop through these blocks."""
        names = ", ".join(self.blocks[i].name for i in members)
        return AlgebraicLoop(
            f"{self.name}: algebraic loop through {names}; each output depends on itself at the "
            "same instant, and not by (piecewise) linear equations with one solution: put a state "
            "(a lag, a sensor) or a sample of delay between them."
        )


@dataclass(frozen=True, eq=False)
class Part:
    """A block, the names of its signals in the net, and the number of its sample time; ``group``
    is None if the block acts at every instant."""

    block: Any
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    group: int | None = None

    @property
    def sampled(self) -> bool:
        return self.group is not None

    @property
    def nstates(self) -> int:
        return int(self.block.nstates or 0)


@dataclass(frozen=True, eq=False)
class Net:
    """Parts, whose outputs of the same name are added, and the external signals.

    ``earlier``: at an update the sampled parts read the values of the others just before it, like
    a converter that measures before it sets its output; otherwise all values are simultaneous.
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
        group = 0 if sampled and system.isdtime(strict=True) else None
        part = Part(system, tuple(system.input_labels), tuple(system.output_labels), group)
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
    def wires(self) -> Wires:
        """The connections by name; what comes from outside comes from there alone."""
        read = [label for part in self.parts for label in part.inputs]
        entry = _equal(read, self.outside)
        connect = _equal(read, self._made) * (entry.sum(axis=1, keepdims=True) == 0.0)
        return Wires(self.name, [part.block for part in self.parts], connect, entry)

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
    places: dict[str, list[int]] = {}
    for k, label in enumerate(columns):
        places.setdefault(label, []).append(k)
    matrix = np.zeros((len(rows), len(columns)))
    for row, label in zip(matrix, rows, strict=True):
        row[places.get(label, [])] = 1.0
    return matrix
