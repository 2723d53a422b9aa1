"""Which runs cannot keep the past of a signal: their dead times are approximations."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

DELAY = "input_delay"


def warn_if_approximate(systems: Sequence[Any], params: Mapping[str, Any] | None) -> None:
    """A warning that names the first block with a dead time, where a run approximates it."""
    for block in systems:
        for inner in _blocks(block):
            late = max(_delays(inner, params or {}), default=0.0)
            if late > 0.0:
                warnings.warn(
                    f"{inner.name}: in this run its dead time of {late:g} s is the Pade "
                    "approximation of order 2; it is exact where lg.simulate compiles all blocks, "
                    "with its own method.",
                    RuntimeWarning,
                    stacklevel=5,
                )
                return


def _blocks(system: Any) -> Iterator[Any]:
    for inner in getattr(system, "syslist", ()):
        yield from _blocks(inner)
    if not hasattr(system, "syslist"):
        yield system


def _delays(block: Any, params: Mapping[str, Any]) -> Iterator[float]:
    """The dead times of a block of the package, its own or those of a model inside it."""
    answer: Any = getattr(block, "outfcn", None)
    made = getattr(answer, "block", None)
    if made is None or block.isdtime(strict=True):
        return
    parts = getattr(made.function, "parts", ())
    keys = ["delay"] if made.name == DELAY else []
    keys += [f"{part.prefix}delay" for part in parts if part.block.name == DELAY]
    for key in keys:
        name = answer.keys.get(key)
        if name is not None:
            yield float(params.get(name, block.params[name]))
