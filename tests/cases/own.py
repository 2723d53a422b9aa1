"""What tests of simulations write again and again: a block of one's own, a signal of a response."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np


def user_block(
    update: Any,
    output: Any,
    inputs: Any,
    outputs: Any,
    states: Any = None,
    name: str | None = None,
    **more: Any,
) -> Any:
    """A block of functions of t, x, u, params; ``more`` are its dt and its parameters, those with
    a dot in their name as a dict ``params``."""
    time = {"dt": more.pop("dt")} if "dt" in more else {}
    more = {**more.pop("params", {}), **more}
    names = {"inputs": inputs, "outputs": outputs, "states": states, "name": name}
    return ct.nlsys(update, output, params=more, **names, **time)


def row(response: Any, label: str) -> np.ndarray:
    """One output of a response."""
    return np.atleast_2d(response.outputs)[list(response.output_labels).index(label)]


def moving(
    update: Any, /, states: Any, name: str | None = None, inputs: Any = "u", **more: Any
) -> Any:
    """A block whose outputs are its states."""
    return user_block(update, None, inputs, states, states, name, **more)


def static(output: Any, /, inputs: Any, outputs: Any, name: str | None = None, **more: Any) -> Any:
    """A block without states."""
    return user_block(None, output, inputs, outputs, None, name, **more)
