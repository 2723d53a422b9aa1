"""Continuous and sampled blocks, connected by their signal names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from .instant import loop_message


@dataclass(frozen=True, eq=False)
class Part:
    """A block, the names of its signals in the net, and the number of its sample time.

    ``group`` is None if the block acts at every instant.
    """

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
    def of(cls, system: Any) -> Net:
        """Return the net of one system, in continuous or in discrete time."""
        group = 0 if system.isdtime(strict=True) else None
        part = Part(system, tuple(system.input_labels), tuple(system.output_labels), group)
        return cls(system.name, (part,), part.inputs, int(part.sampled), alone=True)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """All output names, each once."""
        if self.alone:
            return self.parts[0].outputs
        return tuple(dict.fromkeys(k for part in self.parts for k in part.outputs))

    @cached_property
    def sources(self) -> dict[str, list[tuple[int, int]]]:
        """Part and output that feed each signal."""
        found: dict[str, list[tuple[int, int]]] = {k: [] for k in self.signals}
        for i, part in enumerate(self.parts):
            for j, label in enumerate(part.outputs):
                found[label].append((i, j))
        return found

    @cached_property
    def held(self) -> list[tuple[int, int]]:
        """Part and output of each value that is held between updates."""
        return [
            (i, j)
            for i, part in enumerate(self.parts)
            if part.sampled
            for j in range(len(part.outputs))
        ]

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
        if self.alone:
            own = self.parts[0] if self.parts[0].nstates else None
            return tuple(own.block.state_labels) if own and sampled in (None, own.sampled) else ()
        return tuple(
            f"{part.block.name}_{label}"
            for part in self.parts
            if part.nstates and sampled in (None, part.sampled)
            for label in part.block.state_labels
        )

    @property
    def looped(self) -> bool:
        """Whether there are several blocks, which may feed each other back."""
        return len(self.parts) > 1 or any(hasattr(p.block, "syslist") for p in self.parts)

    @property
    def wiring(self) -> tuple[Any, ...]:
        """All but the blocks themselves."""
        parts = tuple((part.inputs, part.outputs, part.group) for part in self.parts)
        return parts, self.outside, self.groups, self.earlier, self.alone, self.name

    def count(self, sampled: bool) -> int:
        """The number of states of the continuous or the sampled parts."""
        return sum(part.nstates for part in self.parts if part.sampled is sampled)

    def loop_message(self, members: Sequence[int]) -> str:
        """The message on an algebraic loop through these parts."""
        return loop_message(self.name, ", ".join(self.parts[i].block.name for i in members))
