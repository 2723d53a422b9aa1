"""The values of a gain at which a loop begins or ceases to hunt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.validation import positive, shown

SCANNED = 9  # values of a gain between its ends
CLOSE = 1e-3  # relative width of the bracket of a critical value
GAINS = ("kp", "ki", "kd", "kv")


def changes(
    hunts: Callable[..., bool], vary: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, ...]]:
    """By gain where ``hunts(ki=...)`` changes: scanned in even ratios, then bisected."""
    found = {}
    for name, (low, high) in vary.items():
        values = np.geomspace(low, high, SCANNED)
        known = [hunts(**{name: float(v)}) for v in values]
        pairs = zip(values, values[1:], known, known[1:], strict=False)
        found[name] = tuple(_bisected(hunts, name, a, b, ka) for a, b, ka, kb in pairs if ka != kb)
    return found


def ranges(given: Any, what: str, names: tuple[str, ...] = GAINS) -> dict[str, tuple[float, float]]:
    """Gains and their ends; InputError names the argument."""
    if isinstance(given, Mapping) and (unknown := [k for k in given if k not in names]):
        raise InputError(
            f"{what}: there is no gain {shown(unknown[0])}; known: {', '.join(names)}."
        )
    if not isinstance(given, Mapping) or not given:
        example = '{"ki": (1, 50)}'
        raise InputError(f"{what} must be gains and their ends, {example}, not {shown(given)}.")
    made = {}
    for name, ends in given.items():
        if not isinstance(ends, (tuple, list)) or len(ends) != 2:
            raise InputError(f"{what}: {name} needs its two ends, not {shown(ends)}.")
        low, high = (positive(v, f"{what}: {name}") for v in ends)
        if low >= high:
            raise InputError(f"{what}: {name} goes from {low:g} to {high:g}; give them increasing.")
        made[name] = (low, high)
    return made


def _bisected(hunts: Callable[..., bool], name: str, a: float, b: float, at_a: bool) -> float:
    while b / a - 1.0 > CLOSE:
        middle = float(np.sqrt(a * b))
        a, b = (middle, b) if hunts(**{name: middle}) == at_a else (a, middle)
    return float(np.sqrt(a * b))
