"""A stretch with what the balance needs of its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...record.stretch import Stretch
from ..dataset.measured_bristle import strokes
from .constants import SHORTEST
from .kernels import wholly


@dataclass(frozen=True, eq=False)
class Track:
    """A stretch without gaps in its arrays, and the speed at every sample.

    ``age`` runs from -1/2 at the start of the first run to 1/2 at the end of the last one.
    ``still`` is a speed below which the direction is noise. ``stopping`` and ``starting`` are,
    where the drive rests, the direction of the motion before and after, elsewhere 0. ``load`` is
    the load torque, for friction that depends on it, ``d`` the measured one, which acts against
    ``u``. ``most`` limits the number of windows, ``jitter`` is that of the stamps, in steps.
    """

    run: int
    dt: float
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray | None
    ok: np.ndarray
    age: np.ndarray
    speed: np.ndarray = field(default_factory=lambda: np.zeros(0))
    still: float = 0.0
    stopping: np.ndarray = field(default_factory=lambda: np.zeros(0))
    starting: np.ndarray = field(default_factory=lambda: np.zeros(0))
    load: np.ndarray = field(default_factory=lambda: np.zeros(1))
    most: int | None = None
    jitter: float = 0.0
    d: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.u)

    @property
    def duration(self) -> float:
        return len(self.u) * self.dt

    @cached_property
    def strokes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The path (N,), and the first sample and the direction of each stroke between reversals.

        Speeds that are noise count as rest.
        """
        v = np.where(np.abs(self.speed) > self.still, self.speed, 0.0)
        path, first, sides = strokes(v)
        return path * self.dt, first, sides

    def centres(self, reach: int, step: int) -> np.ndarray:
        """Samples ``step`` apart around which ``reach`` samples on each side are good."""
        at = np.arange(reach, len(self.u) - reach, max(step, 1))
        at = at[wholly(self.ok, reach, at)]
        if self.most is not None and len(at) > self.most:
            at = at[np.linspace(0, len(at) - 1, self.most).astype(int)]
        return at


def tracks_of(stretches: Sequence[Stretch]) -> list[Track]:
    """The stretches that are long enough, with the channels that all of them have."""
    good = [s for s in stretches if np.count_nonzero(s.ok) > SHORTEST]
    both = {k: all(getattr(s, k) is not None for s in good) for k in ("theta", "w", "d")}
    lengths = [len(s.u) * s.dt for s in good]
    starts = np.append(0.0, np.cumsum(lengths))
    made = []
    for s, start in zip(good, starts[:-1], strict=True):
        ok = np.asarray(s.ok, bool) & np.isfinite(s.u)
        for k in both:
            ok = ok & (np.isfinite(getattr(s, k)) if both[k] else True)
        filled = {k: _filled(getattr(s, k), ok) if both[k] else None for k in both}
        age = (start + s.t - s.t[0]) / starts[-1] - 0.5
        u, theta, w, d = _filled(s.u, ok), filled["theta"], filled["w"], filled["d"]
        made.append(Track(s.run, float(s.dt), s.t, u, theta, w, ok, age, jitter=s.jitter, d=d))
    return made


def _filled(x: np.ndarray, ok: np.ndarray) -> np.ndarray:
    """The values, with a straight line across bad samples (no window uses these)."""
    x = np.asarray(x, float)
    if ok.all() or not ok.any():
        return np.where(ok, x, 0.0)
    return np.interp(np.arange(len(x)), np.flatnonzero(ok), x[ok])
