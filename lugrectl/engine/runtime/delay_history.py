"""What a delayed signal was: polynomials of degree 4, each over a panel of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

NODES = np.arange(5) / 4  # of a panel, as parts of its length
_FIT = np.linalg.inv(np.vander(NODES, increasing=True))
_FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
INSIDE = 1e-5  # part of a panel by which its ends are moved inwards to find the side of a jump


def coefficients(values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Polynomials in the time since the start of each panel, (P, 5), from their values (P, 5)."""
    return (values @ _FIT.T) / lengths[:, None] ** np.arange(5)


def polynomial(rows: Any, since: Any) -> Any:
    """The value of a polynomial from its coefficients, lowest power first: numbers or nodes."""
    value = rows[-1]
    for row in rows[-2::-1]:
        value = value * since + row
    return value


def roughness(values: np.ndarray) -> np.ndarray:
    """The fourth difference of the values (P, 5) at the nodes: above the error of the fit."""
    return np.abs(values @ _FOURTH)


def nodes(edges: np.ndarray) -> np.ndarray:
    """The nodes (P, 5) of the panels between the edges (P + 1,)."""
    made = edges[:-1, None] + np.diff(edges)[:, None] * NODES
    made[:, -1] = edges[1:]
    return made


class History:
    """One signal until now; constant before ``start``."""

    def __init__(self, start: float, value: float, delay: float) -> None:
        self.delay, self.size = float(delay), abs(float(value))
        self._starts = np.array([start - 1.0])
        self._rows = np.array([[value, 0.0, 0.0, 0.0, 0.0]])
        self._end = start

    def late(self, edges: np.ndarray) -> np.ndarray:
        """The delayed signal at the nodes (P, 5) of panels; at a jump, on the panel's own side."""
        at = nodes(edges) - self.delay
        middle = at[:, 2:3]
        return self._values(at, middle + (1.0 - INSIDE) * (at - middle))

    def late_from(self, t: np.ndarray, length: float) -> np.ndarray:
        """The delayed signal just after the times t (N,)."""
        at = t - self.delay
        return self._values(at, at + INSIDE * length)

    def _values(self, at: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        k = np.maximum(np.searchsorted(self._starts, chosen, side="right") - 1, 0)
        s, rows = at - self._starts[k], self._rows[k]
        return polynomial(np.moveaxis(rows, -1, 0), s)

    def extend(self, edges: np.ndarray, values: np.ndarray, rtol: float) -> list[float]:
        """Add panels with their values (P, 5); the times at which the delayed signal is not
        smooth."""
        lengths = np.diff(edges)
        rows = coefficients(values, lengths)
        self.size = max(self.size, float(np.max(np.abs(values))))
        before = np.vstack([self._rows[-1:], rows[:-1]])
        since = np.append(edges[0] - self._starts[-1], lengths[:-1])
        powers = since[:, None] ** np.arange(5)
        jump = np.abs(np.sum(before * powers, axis=1) - rows[:, 0])
        slope = np.sum(before[:, 1:] * np.arange(1, 5) * powers[:, :-1], axis=1)
        bend = np.abs(slope - rows[:, 1]) * np.minimum(lengths, np.append(lengths[0], since[1:]))
        broken = edges[:-1][np.maximum(jump, bend) > 10 * rtol * self.size]
        recent = np.searchsorted(self._starts, edges[-1] - 2.0 * self.delay) - 1
        kept = slice(max(int(recent), 0), None)
        self._starts = np.append(self._starts[kept], edges[:-1])
        self._rows = np.vstack([self._rows[kept], rows])
        return [float(t) + self.delay for t in broken]


def joined(edges: Sequence[float], more: Sequence[float], near: float) -> np.ndarray:
    """Sorted edges with the other times that are farther than ``near`` from all of them."""
    made = np.array(edges, dtype=float)
    for t in sorted(more):
        if np.min(np.abs(made - t)) > near:
            made = np.append(made, t)
    return np.sort(made)
