"""Functions along the border of stability: where they change their sign, peak and turn.

They are evaluated at many frequencies at once, dense about every pole and zero and in every turn of
a dead time. Between two of these a function changes its sign once at most, or has one extreme,
which is looked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import InputError

Function = Callable[[np.ndarray], np.ndarray]
SHOWN = 2  # bands below 0 that are named
PER_DECADE, PER_TURN = 50, 16  # points
BEYOND = 30.0  # they reach this factor beyond the outermost pole, zero or mark
ROUND = np.tan(np.linspace(-1.5, 1.5, 61))  # points about each pole, in widths of its peak
PARTS = 16  # of a stretch in which an extreme or a change of sign is looked for
STEP = 0.8  # rad that a function turns between two points at most
MOST = 2_000_000  # points


def spread(
    roots: Any, *marks: float, late: float = 0.0, top: float = math.inf, end: float = math.inf
) -> np.ndarray:
    """Frequencies from far below to far above all roots (1/s) and marks, or to ``end``, never above
    ``top``; ``late``: the longest dead time in s."""
    roots = np.asarray(roots, dtype=complex)
    places = np.array([*np.abs(roots), *marks, 1.0 / late if late else 0.0, end])
    places = places[(places > 0.0) & (places <= min(top, 1e100))]
    places = places if len(places) else np.array([min(top / BEYOND, 1.0)])
    low = float(places.min()) / BEYOND
    high = min(max(end if math.isfinite(end) else BEYOND * places.max(), 2.0 * low), top)
    turns = high * late * PER_TURN / (2.0 * math.pi)
    if turns > MOST:
        raise InputError(
            "the response turns too often to be followed: dead time times bandwidth is above "
            "about 1e5; check the unit of the dead time, s."
        )
    peaks = np.abs(roots.imag)[:, None] + np.abs(roots.real)[:, None] * ROUND
    even = np.geomspace(low, high, math.ceil(PER_DECADE * math.log10(high / low)) + 2)
    w = np.concatenate([even, places, peaks.ravel(), np.arange(1.0, turns) * high / (turns or 1.0)])
    return np.unique(w[(w >= low) & (w <= high)])


def from_0(w: np.ndarray) -> np.ndarray:
    """0 and a few frequencies far below the others, too."""
    return np.concatenate([[0.0], np.geomspace(1e-9 * w[0], w[0], 91)[:-1], w])


def tops(
    f: Function, low: np.ndarray, high: np.ndarray, rounds: int = 8
) -> tuple[np.ndarray, np.ndarray]:
    """Where f is largest in each of many intervals with one extreme, and its value there."""
    each = np.arange(len(low))
    for _ in range(rounds):
        w = np.linspace(low, high, PARTS + 1)
        values = f(w.ravel()).reshape(w.shape)
        k, step = np.argmax(values, axis=0), (high - low) / PARTS
        at = w[k, each]
        low, high = np.maximum(at - step, low), np.minimum(at + step, high)
    return at, values[k, each]


def roots(f: Function, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where f changes its sign in each of many intervals."""
    each = np.arange(len(low))
    for _ in range(13):
        w = np.linspace(low, high, PARTS + 1)
        above = (f(w.ravel()) > 0).reshape(w.shape)
        k = np.argmax(above[1:] != above[0], axis=0)
        low, high = w[k, each], w[k + 1, each]
    return 0.5 * (low + high)


def with_extremes(
    function: Callable[[np.ndarray], Any], w: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The frequencies, those between them at which a function is next to 0 too, its values and what
    rounding may change of these."""

    def towards_0(x: np.ndarray) -> np.ndarray:
        return -function(x)[0] * np.broadcast_to(sign, (PARTS + 1, len(sign))).ravel()

    value, slack = np.broadcast_arrays(*function(w))
    size = np.abs(np.where(np.isfinite(value), value, np.inf))
    k = 1 + np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:]))
    k = k[(value[k] * value[k - 1] > 0) & (value[k] * value[k + 1] > 0)]
    if len(k):
        sign = np.sign(value[k])
        at, _ = tops(towards_0, w[k - 1], w[k + 1], 5)
        more = (at, *np.broadcast_arrays(*function(at)))
        w, value, slack = (np.append(*pair) for pair in zip((w, value, slack), more, strict=True))
        order = np.argsort(w, kind="stable")
        w, value, slack = w[order], value[order], slack[order]
    return w, value, slack


def turned(f: Function, w: np.ndarray) -> tuple[np.ndarray, float, float | None]:
    """The frequencies, with more of them where f turns fast; the angle in rad by which it turns
    from the first to the last; and a place at which it is 0 within rounding."""
    while len(w) < MOST:
        values = f(w)
        if (zero := w[values == 0.0]).size:
            return w, math.nan, float(zero[0])
        angles = np.angle(values[1:] / values[:-1])
        k = np.flatnonzero(np.abs(angles) > STEP)
        if not len(k):
            return w, float(angles.sum()), None
        lost = w[k + 1] - w[k] < 1e-14 * w[k + 1]
        if lost.any():
            return w, math.nan, float(w[k[lost][0]])
        w = np.insert(w, k + 1, 0.5 * (w[k] + w[k + 1]))
    raise InputError("the response turns too often to be followed.")


class Signs(NamedTuple):
    """The sign just above w = 0 (0 of a function that is 0), where it changes, and where the
    function is 0, or may be by rounding, between points of one sign or at an end; ``complete``:
    there are no more changes at higher frequencies; ``end``: up to where it is known."""

    first: int
    changes: tuple[float, ...] = ()
    touches: tuple[float, ...] = ()
    complete: bool = True
    end: float = math.inf

    @classmethod
    def of(cls, function: Callable[[np.ndarray], Any], w: np.ndarray) -> Signs:
        """Of a function and what rounding may change of it."""
        w, value, slack = with_extremes(function, w)
        sure = np.flatnonzero(np.abs(value) > slack)
        at, above = w[sure], value[sure] > 0
        turns = np.flatnonzero(above[1:] != above[:-1])
        changes = roots(lambda x: function(x)[0], at[turns], at[turns + 1]).tolist()
        gaps = enumerate(pairwise([-1, *sure.tolist(), len(w)]))
        touches = [float(w[a + 1]) for i, (a, b) in gaps if b > a + 1 and i - 1 not in turns]
        return cls(1 if not len(above) or above[0] else -1, tuple(changes), tuple(touches))

    @property
    def places(self) -> list[float]:
        return sorted({*self.changes, *self.touches})

    @property
    def band_edge(self) -> float:
        """End of the band from w = 0 in which the function is above 0."""
        if self.first <= 0:
            return 0.0
        return min([*self.changes[:1], *[w for w in self.touches if w > 0][:1]], default=self.end)

    def moved(self, place: Callable[[float], float]) -> Signs:
        """The same along another variable."""
        changes, touches = (tuple(map(place, part)) for part in (self.changes, self.touches))
        return self._replace(changes=changes, touches=touches)

    def below(self, last: float) -> str:
        """The bands below 0, in words; ``last``: the highest frequency there is."""
        pairs: Sequence[tuple[float, float]]
        pairs = list(pairwise([*[0.0] * (self.first < 0), *self.changes, last]))[0::2]

        def band(low: float, high: float) -> str:
            if math.isfinite(high):
                start = f"{low:.6g} < w" if low else "w"
                return f"for {start} < {high:.6g} rad/s"
            return f"for w > {low:.6g} rad/s" if low else "at every w"

        if not self.complete:
            return f"first {band(*pairs[0])}, and again and again as w grows"
        more = len(pairs) - SHOWN
        said = " and ".join(band(*pair) for pair in pairs[:SHOWN])
        return said + (f" and at {more} higher places" if more > 0 else "")
