"""The values of a gain at which a loop begins or ceases to hunt."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.validation import positive, shown

SCANNED = 9  # values of a gain between its ends
CLOSE = 1e-3  # relative width of the bracket of a critical value
GAINS = ("kp", "ki", "kd", "kv")


Hunts = Callable[..., bool | None]


Changes = dict[str, tuple[tuple[Any, bool], ...]]


def changes(hunts: Hunts, vary: Mapping[str, tuple[float, float]]) -> Changes:
    """By gain where ``hunts(ki=...)`` changes, and whether it begins there as the gain rises:
    scanned in even ratios, then bisected; two ends where it is None, undecided, between them."""
    found: Changes = {}
    for name, (low, high) in vary.items():
        values = [float(v) for v in np.geomspace(low, high, SCANNED)]
        at = cache(lambda v, name=name: hunts(**{name: v}))
        sure = [v for v in values if at(v) is not None]
        pairs = zip(sure, sure[1:], strict=False)
        found[name] = tuple((_change(at, a, b), bool(at(b))) for a, b in pairs if at(a) != at(b))
    return found


def _change(at: Callable[[float], bool | None], a: float, b: float) -> Any:
    """Where the answer at a ends, and that at b begins if it is later."""
    a, middle = _edge(lambda v: at(v) == at(a), a, b)
    if at(middle) == at(b):
        return float(np.sqrt(a * middle))
    return a, _edge(lambda v: at(v) == at(b), b, middle)[0]


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


def values_of(found: Changes) -> dict[str, tuple[Any, ...]]:
    """The values alone."""
    return {name: tuple(value for value, _ in every) for name, every in found.items()}


def in_words(found: Changes, what: str) -> Iterator[str]:
    """Where ``what`` begins and ends, a sentence for each gain."""
    for name, every in found.items():
        said = [
            f"{'begins' if begins else 'ends'} "
            + (f"at {v:.4g}" if np.isscalar(v) else "between {:.4g} and {:.4g}".format(*v))
            for v, begins in every
        ]
        yield f"as {name} rises, {what} {', '.join(said) or 'neither begins nor ends'}"


def _edge(holds: Callable[[float], bool], a: float, b: float) -> tuple[float, float]:
    """The last value from a towards b at which it holds, and the next at which it does not."""
    while abs(np.log(b / a)) > CLOSE:
        middle = float(np.sqrt(a * b))
        a, b = (middle, b) if holds(middle) else (a, middle)
    return a, b
