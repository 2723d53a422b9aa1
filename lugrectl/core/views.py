"""Who draws and writes a result: functions of the report, which a result names instead of importing
them, so that computing neither draws nor prints.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any


def view(name: str, room: str = "report") -> Callable[..., Any]:
    """The function ``MODULE.NAME`` of a room: ``view("loop_plots.tracking")(result, ax)``."""
    module, _, function = name.rpartition(".")
    return getattr(import_module(f"lugrectl.{room}.{module}".rstrip(".")), function)
