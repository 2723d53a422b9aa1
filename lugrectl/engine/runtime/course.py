"""What a run is asked for and what it gives: times, updates and inputs; states and signals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Accuracy:
    """The error allowed in a step: relative to the size of a state, and near zero in its unit."""

    rtol: float
    atol: float | None = None

    @property
    def floor(self) -> float:
        """The value of a state below which its error is absolute."""
        return 1e-9 if self.atol is None else float(self.atol) / float(self.rtol)

    @property
    def scipy(self) -> dict[str, float]:
        """The options of ``solve_ivp``."""
        return {"rtol": self.rtol, "atol": 1e-4 * self.rtol if self.atol is None else self.atol}


@dataclass(frozen=True)
class Course:
    """The times at which a net is stepped, the updates there, and the points to keep.

    ``grid`` (N,) are updates and requested times, ``given`` (m, N) the external inputs, which
    ``hold`` holds between grid points. ``flags`` (groups, N) are 1 for an update of a sample time,
    0.5 if only its outputs are requested. ``column`` (N,) is the place among the kept points, -1:
    not kept; None: all are kept.
    """

    grid: np.ndarray
    given: np.ndarray
    flags: np.ndarray
    column: np.ndarray | None
    hold: bool

    @classmethod
    def along(cls, t: np.ndarray, u: np.ndarray, groups: int, hold: bool) -> Course:
        """Return a course with updates of all sample times at each time, all of them kept."""
        return cls(t, u, np.ones((groups, len(t))), None, hold)

    @property
    def ticks(self) -> np.ndarray:
        return np.asarray((self.flags > 0.0).any(axis=0))

    @property
    def columns(self) -> np.ndarray:
        return np.arange(len(self.grid)) if self.column is None else self.column

    @property
    def kept(self) -> Any:
        """The kept points, as an index of the grid."""
        return slice(None) if self.column is None else np.flatnonzero(self.column >= 0)


@dataclass(frozen=True)
class Track:
    """Continuous states, sampled states and signals at the kept points; ``unsettled`` is the last
    time at which the error test was given up because a relay did not come to rest (nan: never)."""

    x: np.ndarray
    q: np.ndarray
    y: np.ndarray
    unsettled: float


@dataclass(frozen=True)
class Now:
    """Where a run is: continuous states, sampled states, held values, and the sizes of the
    continuous states (``Adaptive.run``)."""

    x: np.ndarray
    q: np.ndarray
    h: np.ndarray
    sizes: np.ndarray

    @classmethod
    def start(cls, x: np.ndarray, q: np.ndarray, held: int) -> Now:
        return cls(x.copy(), q.copy(), np.zeros(held), np.zeros(3 * len(x)))

    def copy(self) -> Now:
        return Now(self.x.copy(), self.q.copy(), self.h.copy(), self.sizes.copy())
