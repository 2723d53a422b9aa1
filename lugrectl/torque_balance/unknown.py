"""Unknown torques: smooth functions of each set of signals, as rows of the table."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import BSpline

from ..core.numeric import rms
from ..core.regression import TINY, Prior
from .constants import SCREEN
from .table import Contender, Table

SIZES = (0.04, 0.2)  # of friction: standard deviations that an unknown torque may have
QUICK = 0.1  # the same in the first pass
Signals = tuple[str, ...]


class Unknown:
    """Unknown torques beside one base: penalised columns over sets of signals."""

    def __init__(self, table: Table, linear: bool, sure: bool) -> None:
        self.table, self.view, self.sure = table, table.view, sure
        m = self.view.motion
        turns = float(np.ptp(m.theta)) > 6.5 and not linear
        x = (m.theta - m.theta.min()) / (float(np.ptp(m.theta)) + 1e-12)
        w = 0.5 + 0.5 * np.clip(m.w / m.top, -1, 1)
        time = m.elapsed / m.duration
        K = self.view.K
        self.place = waves(m.theta, 12) if turns else spline(x, 16)
        self.coarse = waves(m.theta, 6) if turns else spline(x, 8)
        self.places = [self.place, *([spline(x, 16)] if turns else [])]
        self.times = spline(time, 10)
        sided = spline(np.abs(m.w) / m.top, 16) * np.sign(m.w)[:, None]
        if self.view.is_map:  # a few speeds of several decades, both directions or one
            pace = np.unique(np.abs(m.w), return_inverse=True)[1]
            by_speed = spline(pace / pace.max(), 12)
            sided = by_speed * np.sign(m.w)[:, None]
            ways = [K @ (by_speed * on[:, None]) for on in (m.w > 0, m.w < 0) if on.any()]
        self.still: dict[Signals, list[np.ndarray]] = {
            ("theta",): [K @ place for place in self.places],
            ("w",): [K @ sided, *ways] if self.view.is_map else [K @ sided],
            ("t",): [K @ spline(time, 24)],
        }
        self.mixed = K @ product(spline(w, 6), self.coarse)

    def _bases(self) -> Iterator[tuple[Signals, list[np.ndarray]]]:
        """Columns (m, k) over each set of signals; what depends on u or the law is made anew."""
        v, m, K = self.view, self.view.motion, self.view.K
        u = m.held(v.u)
        yield from self.still.items()
        size = max(np.quantile(np.abs(u), 0.995), 0.1 * np.abs(u).max(), TINY)
        of_u = spline(0.5 + 0.5 * np.clip(u / size, -1, 1), 12)
        friction = np.column_stack([v.z, m.w / m.top])
        if self.sure:  # without J any function of u is u
            yield ("u",), [K @ without_line(often(of_u), u)]
        here = [K @ (v.z[:, None] * place) for place in self.places]
        yield ("theta", "w"), [*here, self.mixed]
        yield ("t", "w"), [K @ product(self.times, friction)]
        if self.sure:
            yield ("t", "u"), [K @ without_line(u[:, None] * self.times, u)]
            yield ("theta", "u"), [K @ without_line(u[:, None] * self.coarse, u)]

    def rows(self) -> list[Contender]:
        """The contenders, the likeliest first; in the first pass by their promise alone."""
        made, quick = [], self.table.quick
        for depends_on, bases in self._bases():
            for C in bases if self.view.signals >= set(depends_on) else ():
                for size in (QUICK,) if quick else SIZES:
                    c = self._contender(depends_on, C, size, len(bases))
                    c.gain = self.table.promise(c) - c.cost
                    made.append(c)
        if not quick:
            made = self.table.entered([(c.gain, c) for c in made if c.gain > 2 * SCREEN])
        return likeliest(made)

    def _contender(self, depends_on: Signals, C: np.ndarray, size: float, many: int) -> Contender:
        large = np.sqrt(np.mean(C**2, axis=0))
        sigma = size * self.view.size / np.maximum(large, 1e-3 * rms(large) + TINY)
        prior = Prior.free(C.shape[1], precision=1 / sigma**2)
        name = f"g({','.join(depends_on)})"
        cost = float(np.log(3 * many))
        return Contender(name, {}, C=C, prior=prior, cost=cost, depends_on=depends_on)


def likeliest(contenders: list[Contender]) -> list[Contender]:
    """The best of each name, the likeliest first."""
    best: dict[str, Contender] = {}
    for c in contenders:
        if c.name not in best or c.gain > best[c.name].gain:
            best[c.name] = c
    return sorted(best.values(), key=lambda c: -c.gain)


def waves(theta: np.ndarray, n: int) -> np.ndarray:
    """The first n harmonics of an angle, (m, 2 n)."""
    turns = theta[:, None] * np.arange(1, n + 1)
    return np.stack([np.sin(turns), np.cos(turns)], axis=2).reshape(len(theta), -1)


def spline(x: np.ndarray, n: int) -> np.ndarray:
    """n cubic B-splines over [0, 1] at x."""
    knots = np.r_[[0.0] * 3, np.linspace(0, 1, n - 2), [1.0] * 3]
    return BSpline.design_matrix(np.clip(x, 0, 1 - 1e-12), knots, 3).toarray()


def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Every column of A times every column of B."""
    return (A[:, :, None] * B[:, None, :]).reshape(len(A), -1)


def without_line(X: np.ndarray, u: np.ndarray) -> np.ndarray:
    """X without what 1 and u explain of it."""
    A = np.column_stack([np.ones(len(u)), u])
    return X - A @ np.linalg.lstsq(A, X, rcond=None)[0]


def often(X: np.ndarray) -> np.ndarray:
    """Columns that are not zero on 2 % of the samples: without u, a rare one is u elsewhere."""
    return X[:, np.mean(X > 0.05, axis=0) > 0.02]
