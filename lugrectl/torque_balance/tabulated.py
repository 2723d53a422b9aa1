"""An unknown torque as a table over the signals that it depends on: hat functions in the rows of a
last fit, as stiff as left-out blocks ask (Eilers and Marx, Statistical Science 11(2), 1996)."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, hstack

from ..blocks.block import unit_for
from ..core.numeric import Z95
from ..core.regression import TINY
from ..estimates.findings import Table
from .last_fit import LastFit

KNOWN = (("theta",), ("theta", "w"), ("w",), ("t",), ("t", "w"), ("u",))
INSTEAD: dict[tuple[str, ...], tuple[str, ...]]
INSTEAD = {("t", "u"): ("t", "w"), ("theta", "u"): ("theta", "w")}  # u has mostly the sign of w
SIZES = (12, 24, 48, 96)  # points
STIFFNESS = tuple(10.0 ** np.arange(-9.0, 1.0))  # of the curvature, over the rows
BLOCKS, FOLDS = 60, 4  # of rows in time
LOST = 0.02  # of the gain, for fewer points or a periodic table


@dataclass(frozen=True, eq=False)
class _Grid:
    """Points (m,) of a table, its normal equations and curvature by block."""

    points: np.ndarray
    periodic: bool
    G: np.ndarray  # (blocks, k, k)
    g: np.ndarray  # (blocks, k)
    S: np.ndarray  # curvature (k, k)

    def system(self, stiffness: float, seen: np.ndarray) -> np.ndarray:
        H, stiff = self.G[seen].sum(0), stiffness * self.S
        firm = 1e-10 + 1e-14 * np.trace(stiff)  # data at one place determine no straight line
        return H + np.trace(H) * (stiff + firm * np.eye(len(H)))

    def gain(self, stiffness: float, seen: np.ndarray) -> np.ndarray:
        """Power that the table by the blocks ``seen`` explains in each: |r|^2 - |r - A v|^2."""
        v = np.linalg.solve(self.system(stiffness, seen), self.g[seen].sum(0))
        return 2 * self.g @ v - np.einsum("i,bij,j->b", v, self.G, v, optimize=True)

    def left_out(self, stiffness: float, seen: np.ndarray) -> float:
        """The same of blocks that each of the folds of ``seen`` leaves out, in all."""
        folds = [seen & ((np.cumsum(seen) - 1) % FOLDS == k) for k in range(FOLDS)]
        return sum(float(self.gain(stiffness, seen & ~own)[own].sum()) for own in folds)


def tabulated(last: LastFit, depends_on: Collection[str]) -> Table | None:
    """The residual torque of a last fit over ``depends_on``, on the resisting side; None for other
    signals (a function of the acceleration is an inertia), or where nothing is predicted.

    ``share`` of its power is that which tables predict of blocks left out of fit and choice;
    standard errors are those of blocks, widened for the stiffness (Nychka, J. American Statistical
    Association 83, 1988).
    """
    name = tuple(s for s in ("theta", "t", "w", "u") if s in depends_on)
    name, t = INSTEAD.get(name, name), last.view.rows.t
    blocks = np.array_split(np.argsort(t, kind="stable"), min(BLOCKS, max(1, len(t) // 8)))
    if name not in KNOWN or len(blocks) < 2 * FOLDS:
        return None
    r = last.left
    grids, power = list(_grids(last, name, r, blocks)), np.array([r[b] @ r[b] for b in blocks])
    gain, every = np.zeros(len(blocks)), np.ones(len(blocks), bool)
    for own in (np.arange(len(blocks)) % FOLDS == k for k in range(FOLDS)):
        grid, stiffness = _chosen(grids, ~own)
        gain[own] = grid.gain(stiffness, ~own)[own]
    whole = float(power.sum()) + TINY
    share = float(gain.sum()) / whole
    half = Z95 * float(np.sqrt(np.sum((gain - share * power) ** 2))) / whole
    if share - half <= 0:
        return None
    grid, stiffness = _chosen(grids, every)
    inverse, G = np.linalg.inv(grid.system(stiffness, every)), grid.G.sum(0)
    v = inverse @ grid.g.sum(0)
    wider = np.diag(inverse) / np.maximum(np.diag(inverse @ G @ inverse), TINY)
    error = np.sqrt(np.sum(((grid.g - grid.G @ v) @ inverse) ** 2, 0) * np.maximum(wider, 1.0))
    shape, motion = (2, -1) if len(name) == 2 else (-1,), last.view.model.motion
    return Table(
        signals=name, points=grid.points, values=v.reshape(shape), error=error.reshape(shape),
        periodic=grid.periodic, share=share, share95=(share - half, share + half),
        rms=float(np.sqrt(v @ G @ v / len(r))), unit=unit_for("N m", motion), windows=len(blocks),
        motion=motion,
    )  # fmt: skip


def _chosen(grids: list[_Grid], seen: np.ndarray) -> tuple[_Grid, float]:
    """The simplest grid, and its stiffness, that loses next to nothing by blocks left out."""
    tried = [max((grid.left_out(s, seen), s) for s in STIFFNESS) for grid in grids]
    best = max(gain for gain, _ in tried)
    i = next(i for i, (gain, _) in enumerate(tried) if gain >= best - LOST * abs(best))
    return grids[i], tried[i][1]


def _grids(
    last: LastFit, name: tuple[str, ...], r: np.ndarray, blocks: list[np.ndarray]
) -> Iterator[_Grid]:
    """Tables of every size, the simplest first, those of a turn before all others."""
    m, K = last.view.motion, last.view.K
    x = m.held(m.u) if name[0] == "u" else getattr(m, name[0])
    turning = name[0] == "theta" and last.view.model.motion == "rotary" and np.ptp(x) > 2 * np.pi
    sides = [m.w > 0, m.w < 0] if len(name) == 2 else [np.ones(len(x), bool)]
    sizes = [n for n in SIZES if n <= max(SIZES[0], len(r) // 8)]
    for n, turns in ((n, turns) for turns in (True, False)[not turning :] for n in sizes):
        points = np.linspace(x.min(), x.max(), n)
        if name[0] in ("w", "u"):  # half by how often values occur
            points = 0.5 * (points + np.quantile(x, np.linspace(0, 1, n)))
        points = np.linspace(-np.pi, np.pi, n, endpoint=False) if turns else points
        A = hstack([K @ _hats(x, points, turns).multiply(one[:, None]) for one in sides]).toarray()
        G, g = np.array([A[b].T @ A[b] for b in blocks]), np.array([A[b].T @ r[b] for b in blocks])
        yield _Grid(points, turns, G, g, np.kron(np.eye(len(sides)), _curvature(points, turns)))


def _hats(x: np.ndarray, points: np.ndarray, turns: bool) -> csr_matrix:
    """Hat functions (n, m) at x (n,): two of them share each sample."""
    ends = np.r_[points, points[0] + 2 * np.pi] if turns else points
    x = points[0] + (x - points[0]) % (2 * np.pi) if turns else x
    at = np.clip(np.searchsorted(ends, x, "right") - 1, 0, len(ends) - 2)
    part = (x - ends[at]) / (ends[at + 1] - ends[at])
    places = np.repeat(np.arange(len(x)), 2), np.c_[at, (at + 1) % len(points)].ravel()
    return csr_matrix((np.c_[1 - part, part].ravel(), places), (len(x), len(points)))


def _curvature(points: np.ndarray, turns: bool) -> np.ndarray:
    """S with v'S v the integral of f''^2, over a range of length 1."""
    h, ends = np.diff(points) / np.ptp(points), np.eye(len(points))
    if turns:
        change = np.roll(ends, 1, axis=1) - 2 * ends + np.roll(ends, -1, axis=1)
        return change.T @ change * float(len(points)) ** 3
    change = np.diff(np.diff(ends, axis=0) / h[:, None], axis=0)
    return change.T @ (change / (0.5 * (h[1:] + h[:-1]))[:, None])
