"""An unknown torque as a table over the signals that it depends on.

Hat functions in the rows of a last fit, as stiff as blocks that were left out ask: penalised
B-splines of degree 1 (Eilers and Marx, Statistical Science 11(2), 1996).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, hstack

from ..blocks.block import unit_for
from ..core.regression import TINY
from ..estimates.findings import Table
from .constants import Z95
from .last_fit import LastFit

KNOWN = (("theta",), ("theta", "w"), ("w",), ("t",), ("t", "w"), ("u",))
# most of the torque has the sign of the speed
INSTEAD = {("t", "u"): ("t", "w"), ("theta", "u"): ("theta", "w")}
SIZES = (12, 24, 48, 96)  # points
STIFFNESS = tuple(10.0 ** np.arange(-9.0, 1.0))  # of the curvature, over the rows
BLOCKS, FOLDS = 60, 4  # of rows in time
LOST = 0.02  # of the gain, for fewer points


@dataclass(frozen=True, eq=False)
class _Grid:
    """Points (m,) of a table with its normal equations G (blocks, k, k) and g (blocks, k), and its
    curvature S (k, k)."""

    points: np.ndarray
    periodic: bool
    G: np.ndarray
    g: np.ndarray
    S: np.ndarray

    def system(self, stiffness: float, seen: np.ndarray) -> np.ndarray:
        H = self.G[seen].sum(0)
        stiff = stiffness * self.S + (1e-10 + 1e-14 * stiffness * np.trace(self.S)) * np.eye(len(H))
        return H + np.trace(H) * stiff

    def solved(self, stiffness: float, seen: np.ndarray) -> np.ndarray:
        """The table (k,) by the blocks ``seen``, a mask."""
        return np.linalg.solve(self.system(stiffness, seen), self.g[seen].sum(0))

    def gain(self, v: np.ndarray) -> np.ndarray:
        """Power that a table explains in each block: |r|^2 - |r - A v|^2."""
        return 2 * self.g @ v - np.einsum("i,bij,j->b", v, self.G, v, optimize=True)

    def left_out(self, stiffness: float, seen: np.ndarray) -> np.ndarray:
        """That gain, of each block seen by the other folds of these."""
        made, fold = np.zeros(len(seen)), (np.cumsum(seen) - 1) % FOLDS
        for k in range(FOLDS):
            own = seen & (fold == k)
            made[own] = self.gain(self.solved(stiffness, seen & ~own))[own]
        return made


def tabulated(last: LastFit, depends_on: Collection[str]) -> Table | None:
    """The residual torque of a last fit over ``depends_on``, on the resisting side.

    ``share`` of its power is that which tables predict of blocks left out of fit and choice, with
    its 95 % interval; standard errors are those of blocks, widened for the stiffness (Nychka, J.
    American Statistical Association 83, 1988). None for other signals (a function of the
    acceleration is an inertia), or where nothing is predicted.
    """
    name = tuple(s for s in ("theta", "t", "w", "u") if s in depends_on)
    name = INSTEAD.get(name, name)
    order = np.lexsort((last.view.rows.t,))
    blocks = np.array_split(order, min(BLOCKS, max(1, len(order) // 8)))
    if name not in KNOWN or len(blocks) < 2 * FOLDS:
        return None
    r = last.design.y - last.design.X @ last.fit.b
    grids, power = list(_grids(last, name, r, blocks)), np.array([r[b] @ r[b] for b in blocks])
    every, gain = np.ones(len(blocks), bool), np.zeros(len(blocks))
    for k in range(FOLDS):
        own = np.arange(len(blocks)) % FOLDS == k
        grid, stiffness = _chosen(grids, ~own)
        gain[own] = grid.gain(grid.solved(stiffness, ~own))[own]
    share = float(gain.sum() / (power.sum() + TINY))
    half = Z95 * float(np.sqrt(np.sum((gain - share * power) ** 2)) / (power.sum() + TINY))
    if share - half <= 0:
        return None
    grid, stiffness = _chosen(grids, every)
    v, motion = grid.solved(stiffness, every), last.view.model.motion
    error, shape = _error(grid, stiffness, v), (2, -1) if len(name) == 2 else (-1,)
    rms = float(np.sqrt(v @ grid.G.sum(0) @ v / len(r)))
    return Table(
        signals=name, points=grid.points, values=v.reshape(shape), error=error.reshape(shape),
        periodic=grid.periodic, share=share, share95=(share - half, share + half), rms=rms,
        unit=unit_for("N m", motion), windows=len(blocks), motion=motion,
    )  # fmt: skip


def _error(grid: _Grid, stiffness: float, v: np.ndarray) -> np.ndarray:
    every = np.ones(len(grid.G), bool)
    inverse, G = np.linalg.inv(grid.system(stiffness, every)), grid.G.sum(0)
    of_blocks = (grid.g - grid.G @ v) @ inverse
    widened = np.diag(inverse) / np.maximum(np.diag(inverse @ G @ inverse), TINY)
    return np.sqrt(np.sum(of_blocks**2, axis=0) * np.maximum(widened, 1.0))


def _chosen(grids: list[_Grid], seen: np.ndarray) -> tuple[_Grid, float]:
    """The simplest grid, and its stiffness, that loses next to nothing by blocks left out."""
    tried = []
    for grid in grids:
        gains = [float(grid.left_out(s, seen).sum()) for s in STIFFNESS]
        tried.append((max(gains), grid, STIFFNESS[int(np.argmax(gains))]))
    best = max(gain for gain, _, _ in tried)
    return next((grid, s) for gain, grid, s in tried if gain >= best - LOST * abs(best))


def _grids(
    last: LastFit, name: tuple[str, ...], r: np.ndarray, blocks: list[np.ndarray]
) -> Iterator[_Grid]:
    """Tables of every size, the simplest first."""
    m, K, rotary = last.view.motion, last.view.K, last.view.model.motion == "rotary"
    x = m.held(m.u) if name[0] == "u" else getattr(m, name[0])
    turns = name[0] == "theta" and rotary and np.ptp(x) > 2 * np.pi
    sides = [m.w > 0, m.w < 0] if len(name) == 2 else [np.ones(len(x), bool)]
    for n in (n for n in SIZES if n <= max(SIZES[0], len(r) // 8)):
        points = np.linspace(0, 2 * np.pi, n, endpoint=False) if turns else _even(x, n, name[0])
        hats, S = _hats(x, points, turns), _curvature(points, turns)
        A = hstack([K @ hats.multiply(side[:, None]) for side in sides]).toarray()
        G, g = (np.array(one) for one in zip(*((A[b].T @ A[b], A[b].T @ r[b]) for b in blocks),
                                             strict=True))  # fmt: skip
        yield _Grid(points, turns, G, g, np.kron(np.eye(len(sides)), S))


def _even(x: np.ndarray, n: int, name: str) -> np.ndarray:
    """Points over the range; of w and u half by how often values occur."""
    points = np.linspace(x.min(), x.max(), n)
    often = np.quantile(x, np.linspace(0, 1, n)) if name in ("w", "u") else points
    return 0.5 * (points + often)


def _hats(x: np.ndarray, points: np.ndarray, turns: bool) -> csr_matrix:
    """Hat functions (n, m) at x (n,): two of them share each sample."""
    n, ends = len(points), np.r_[points, points[0] + 2 * np.pi] if turns else points
    x = x % (2 * np.pi) if turns else np.clip(x, points[0], points[-1])
    at = np.clip(np.searchsorted(ends, x, "right") - 1, 0, len(ends) - 2)
    part = (x - ends[at]) / (ends[at + 1] - ends[at])
    rows = np.repeat(np.arange(len(x)), 2)
    columns, values = np.c_[at, (at + 1) % n].ravel(), np.c_[1 - part, part].ravel()
    return csr_matrix((values, (rows, columns)), (len(x), n))


def _curvature(points: np.ndarray, turns: bool) -> np.ndarray:
    """S with v'S v the integral of f''^2, over a range of length 1."""
    one = np.eye(len(points))
    if turns:
        change = np.roll(one, 1, axis=1) - 2 * one + np.roll(one, -1, axis=1)
        return change.T @ change * float(len(points)) ** 3
    h = np.diff(points) / (points[-1] - points[0])
    change = np.diff(np.diff(one, axis=0) / h[:, None], axis=0)
    return change.T @ (change / (0.5 * (h[1:] + h[:-1]))[:, None])
