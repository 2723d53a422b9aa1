"""The blocks: one pure function each, registered by one line."""

from __future__ import annotations

from functools import cache
from importlib import import_module

AUTO = "auto"  # in place of a friction law: the one that predicts best
DECLARING = (
    "effects",
    "friction",
    "bristle_laws",
    "multi_element_laws",
    "observers",
    "controllers",
    "drive",
    "sliding_control",
    "repetitive_control",
    "dead_time_control",
)


@cache
def fill() -> None:
    """Import the modules that declare the package's blocks, so that the registry holds them."""
    for module in DECLARING:
        import_module(f".{module}", __name__)
