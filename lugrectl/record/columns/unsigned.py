"""Signed numbers that a log holds as unsigned ones: -1 is written as 65535."""

from __future__ import annotations

import numpy as np

BITS = (16, 32)
SIGNED = ("u", "w")  # channels that have a sign
SAID = (
    "{0} is written as an unsigned number of {1} bit: its values above {2} are read as negative "
    "(minus {3})."
)


def signed(role: str, values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The column of a role (N,) with its signs, and a sentence where they were missing.

    A two's complement leaves the middle half of its range empty and has values on both sides.
    """
    if role not in SIGNED:
        return values, []
    x = values[np.isfinite(values)]
    for bits in BITS:
        whole = 2.0**bits
        if len(x) and x.min() >= 0 and 0.75 * whole <= x.max() < whole and _split(x, whole):
            made = np.where(values >= 0.5 * whole, values - whole, values)
            return made, [SAID.format(role, bits, int(whole / 2) - 1, int(whole))]
    return values, []


def _split(x: np.ndarray, whole: float) -> bool:
    """Whether whole numbers lie on both sides of an empty middle."""
    middle = (x >= 0.25 * whole) & (x < 0.75 * whole)
    low = x < 0.25 * whole
    return not np.any(middle) and bool(low.any() and not low.all()) and not np.any(x % 1)
