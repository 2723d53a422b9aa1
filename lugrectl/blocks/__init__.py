"""The blocks: one pure function each, registered by one line."""

from __future__ import annotations

from functools import cache
from importlib import import_module

AUTO = "auto"  # in place of a friction law: the one that predicts best
DECLARING = ("effects", "friction", "observers", "controllers", "sliding_control")


@cache
def fill() -> None:
    """Fill the registry with the blocks that the package declares."""
    for module in DECLARING:
        import_module(f".{module}", __name__)
