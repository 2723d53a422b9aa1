"""Continuous and sampled blocks, connected by the names of their signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np


def is_wired(system: Any) -> bool:
    """Whether a system is an interconnection."""
    return hasattr(system, "syslist")


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
