"""The dead times of a system of blocks: their values, and where their states stand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

DELAY = "input_delay"


class DeadTime(NamedTuple):
    """A dead time of ``seconds`` in a block; its two states are at ``place`` of the system's."""

    block: str
    seconds: float
    place: int


def dead_times(
    system: Any, params: Mapping[str, Any] | None = None, place: int = 0
) -> Iterator[DeadTime]:
    """The dead times of the package's continuous blocks, their own or those of a model inside."""
    inside = getattr(system, "syslist", None)
    if inside is None:
        yield from _own(system, params or {}, place)
        return
    for one in inside:
        yield from dead_times(one, params, place)
        place += one.nstates


def _own(block: Any, params: Mapping[str, Any], place: int) -> Iterator[DeadTime]:
    answer: Any = getattr(block, "outfcn", None)
    made = getattr(answer, "block", None)
    if made is None or block.isdtime(strict=True):
        return
    parts = getattr(made.function, "parts", ())
    keys = [("delay", made.states)] if made.name == DELAY else []
    keys += [(f"{part.prefix}delay", part.states) for part in parts if part.block.name == DELAY]
    for key, states in keys:
        name = answer.keys.get(key)
        if name is not None:
            at = place + made.states.index(states[0])
            yield DeadTime(block.name, float(params.get(name, block.params[name])), at)
