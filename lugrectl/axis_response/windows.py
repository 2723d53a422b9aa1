"""Local windows of frequency, in which a smooth response and a transient are polynomials.

Schoukens, Vandersteen, Barbe, Pintelon (2009), the local polynomial method. Several runs share
the response; each has a transient of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .runs import Run

ORDER = 2
POWERS = np.arange(ORDER + 1)


@dataclass(frozen=True, eq=False)
class Window:
    """The bins of each run about ``centre`` in rad/s.

    ``poly`` (n, 3) are the powers of the distance from the centre, and ``transient`` (n, m) an
    orthonormal basis of the transients of all runs.
    """

    centre: float
    parts: tuple[slice, ...]
    poly: np.ndarray
    transient: np.ndarray

    def rows(self, spectra: Sequence[np.ndarray]) -> np.ndarray:
        """Spectra of each run (M,) or (M, m), one below the other within the window."""
        return np.concatenate([X[part] for X, part in zip(spectra, self.parts, strict=True)])

    def without_transient(self, rows: np.ndarray) -> np.ndarray:
        return rows - self.transient @ (self.transient.T @ rows)

    @property
    def free(self) -> int:
        """Equations that the transients leave."""
        return len(self.poly) - self.transient.shape[1]


def window(runs: Sequence[Run], centre: float, half: float) -> Window:
    """The window of a half-width in rad/s."""
    parts, polys = [], []
    for run in runs:
        first, last = np.searchsorted(run.w, [centre - half, centre + half])
        part = slice(max(int(first), 1), int(last))
        parts.append(part)
        polys.append(((run.w[part] - centre) / half)[:, None] ** POWERS)
    rows = np.cumsum([0, *map(len, polys)])
    width = ORDER + 1
    basis = np.zeros((rows[-1], width * len(polys)))
    for i, poly in enumerate(polys):
        if len(poly) >= width:
            basis[rows[i] : rows[i + 1], width * i : width * (i + 1)] = np.linalg.qr(poly)[0]
        else:  # too few bins to tell a transient from the response: the run says nothing here
            poly[:] = 0.0
    return Window(centre, tuple(parts), np.concatenate(polys), basis)


def half_width(runs: Sequence[Run], centre: float, bins: int, share: float) -> float:
    """So many bins of the longest run, or a share of the centre frequency where that is wider."""
    return max(bins * min(run.w[1] for run in runs), share * centre)
