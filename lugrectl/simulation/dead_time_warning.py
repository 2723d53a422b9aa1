"""Which runs cannot keep the past of a signal: their dead times are approximations."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from ..blocks.drive import dead_times


def warn_if_approximate(systems: Sequence[Any], params: Mapping[str, Any] | None) -> None:
    """A warning that names the first block with a dead time, where a run approximates it."""
    for system in systems:
        for late in dead_times(system, params):
            if late.seconds > 0.0:
                warnings.warn(
                    f"{late.block}: in this run its dead time of {late.seconds:g} s is the Pade "
                    "approximation of order 2; it is exact where lg.simulate compiles all blocks, "
                    "with its own method.",
                    RuntimeWarning,
                    stacklevel=5,
                )
                return
