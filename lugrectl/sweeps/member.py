"""The name and labels of a system, of any kind, that a sweep needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..core.errors import InputError
from ..core.validation import shown
from ..simulation.block_list import net_of


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
        net, _ = net_of(system)
        own = net.parts[0].block if net.alone else list(system)
        return cls(own, net.name, net.outside, net.signals, net.states(), net.groups > 0)

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
