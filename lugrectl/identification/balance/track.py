"""A stretch with what the balance needs of its motion, and weighted means over windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import Polynomial

from ...blocks.measured_bristle import strokes
from ...record.stretches import Stretch
from .constants import DENSE, SHORTEST

_BUMP = (1 - Polynomial([0, 0, 1])) ** 4
BUMP = _BUMP / (_BUMP.integ()(1) - _BUMP.integ()(-1))
_AREA = BUMP.integ()
IN_CACHE = 32_000  # samples of windows that are weighted at a time
FACTORIAL = (1.0, 1.0, 2.0)


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
    ok_u: np.ndarray
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

    def centres(self, reach: int, step: int, of_u: int = 0) -> np.ndarray:
        """Samples ``step`` apart around which ``reach`` samples on each side are good, and
        ``of_u`` samples of u: a delayed torque is looked at further away than the motion."""
        far = max(reach, of_u)
        at = np.arange(far, len(self.u) - far, max(step, 1))
        at = at[wholly(self.ok, reach, at) & wholly(self.ok_u, far, at)]
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
        of_u = ok if s.ok_u is None else s.ok_u & np.isfinite(s.u)
        kept = {"jitter": s.jitter, "d": d}
        made.append(Track(s.run, float(s.dt), s.t, u, theta, w, ok, of_u, age, **kept))
    return made


def _filled(x: np.ndarray, ok: np.ndarray) -> np.ndarray:
    """The values, with a straight line across bad samples (no window uses these)."""
    x = np.asarray(x, float)
    if ok.all() or not ok.any():
        return np.where(ok, x, 0.0)
    return np.interp(np.arange(len(x)), np.flatnonzero(ok), x[ok])


def weights(half_width: float, order: int, shift: float = 0.0, cell: bool = False) -> np.ndarray:
    """Weights k_j with sum k_j x_j = integral of phi x^(order), in samples.

    Exact for polynomials up to degree order + 1.

    Parameters
    ----------
    half_width : float
        Half-width L of the bump, in samples.
    order : int
        Derivative of x, 0 to 2.
    shift : float
        The bump's centre, in samples after the middle of the weights.
    cell : bool
        For a signal that is held over one sample around its centre: phi is averaged over it.
    """
    half = int(np.ceil(half_width + abs(shift))) + cell
    at = np.arange(-half, half + 1) - shift
    s = np.clip(at / half_width, -1, 1)
    k = _averaged(at, half_width, order) if cell else _derivative(s, half_width, order)
    powers = np.vander(at / half_width, order + 2, increasing=True)
    basis, want = powers * BUMP(s)[:, None], np.zeros(order + 2)
    want[order] = FACTORIAL[order] / half_width**order
    return k + basis @ np.linalg.solve(powers.T @ basis, want - powers.T @ k)


def _derivative(s: np.ndarray, half_width: float, order: int) -> np.ndarray:
    """(-1)^order phi^(order), per sample."""
    bump = BUMP.deriv(order) if order else BUMP
    return bump(s) * (-1) ** order / half_width ** (order + 1)


def _averaged(at: np.ndarray, half_width: float, order: int) -> np.ndarray:
    """The same, averaged over one sample."""
    whole = (BUMP.deriv(order - 1) if order > 1 else BUMP) if order else _AREA
    high, low = (np.clip((at + x) / half_width, -1, 1) for x in (0.5, -0.5))
    return (whole(high) - whole(low)) * (-1) ** order / half_width**order


def means(x: np.ndarray, k: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The weighted means of x with the weights k around the samples ``at``."""
    if len(at) * DENSE > len(x):
        from scipy.signal import oaconvolve  # slow to import

        middle = x[len(x) // 2]  # which keeps rounding small for a large offset
        return oaconvolve(x - middle, k[::-1], "same")[at] + middle * k.sum()
    windows, first = sliding_window_view(x, len(k)), at - len(k) // 2
    size = max(IN_CACHE // len(k), 1)  # a copy of all windows at once would not stay in the cache
    parts = [windows[first[i : i + size]] @ k for i in range(0, len(first), size)]
    return np.concatenate(parts) if parts else np.zeros(0)


def wholly(ok: np.ndarray, reach: int, at: np.ndarray) -> np.ndarray:
    """Which of the samples ``at`` have no bad sample within ``reach``."""
    bad = np.append(0, np.cumsum(~ok))
    return bad[np.minimum(at + reach + 1, len(ok))] == bad[np.maximum(at - reach, 0)]
