"""The name and labels of a system, of any kind, that a sweep needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..core.errors import InputError
from ..core.validation import shown
from ..engine.tracing.network_equations import state_labels
from ..simulation import arguments
from ..simulation.block_list import together, wired


@dataclass(frozen=True)
class Face:
    """Name and labels of a system or a list of blocks. ``sampled``: not in continuous time."""

    system: Any
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    sampled: bool

    @classmethod
    def of(cls, system: Any) -> Face:
        """The labels that ``simulate`` uses; a list of continuous blocks is interconnected."""
        if isinstance(system, (list, tuple)):
            if any(getattr(block, "dt", None) not in (None, 0) for block in system):
                net, _ = wired(system)
                labels = tuple(net.outside), tuple(net.signals), tuple(state_labels(net))
                return cls(list(system), net.name, *labels, sampled=True)
            system = together(system)
        system = arguments.system(system)
        labels = system.input_labels, system.output_labels, system.state_labels
        inputs, outputs, states = map(tuple, labels)
        return cls(system, system.name, inputs, outputs, states, system.isdtime(strict=True))

    def chosen(self, what: str, names: Sequence[str] | str | None) -> tuple[str, ...]:
        """The names of outputs or states (``what``), all for None; InputError if one is unknown."""
        has = self.outputs if what == "output" else self.states
        try:
            chosen = tuple(has if names is None else [names] if isinstance(names, str) else names)
        except TypeError:
            raise InputError(f"{what}s must be a list of names, not {shown(names)}.") from None
        unknown = [name for name in chosen if name not in has]
        if unknown:
            there = ", ".join(has) or "none"
            raise InputError(f"{self.name} has no {what} '{unknown[0]}'; it has {there}.")
        return chosen
