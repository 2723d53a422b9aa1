"""Penalised B-spline table of an unexplained residual torque over the signals it depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve

from ...blocks.block import unit_for
from ...blocks.friction import EPS
from ...estimates.findings import Table
from ..dataset.dataset import Log
from .hat_functions import around, hats, turn, wraps

KNOWN = (("theta",), ("theta", "w"), ("w",), ("t",), ("t", "w"), ("u",))
Names = tuple[str, ...]
# for a torque constant that changes: most of the torque has the sign of the speed
INSTEAD: dict[Names, Names] = {("t", "u"): ("t", "w")}
CELL = 0.01  # s over which the residual torque is averaged
FOLDS = 4
SIZES = (12, 24, 48, 96)  # points of a table
STIFFNESS = tuple(10.0 ** np.arange(-9.0, 1.0))  # weights of the curvature that are tested
BLOCKS = 120  # of windows, at most
DRAWS = 300  # bootstrap samples of the blocks
LEVEL = (2.5, 97.5)  # percentiles of an interval
LOST = 0.02  # of the gain, which may be lost for fewer points


@dataclass(frozen=True)
class _Cells:
    """Residual torque and signals of a block of windows, averaged over short cells."""

    r: np.ndarray
    x: np.ndarray
    w: np.ndarray | None


@dataclass(frozen=True)
class _Grid:
    """Points of a table, whether it is periodic over a turn, and its normal equations.

    ``G`` (blocks, m, m) and ``g`` (blocks, m) are the normal equations of each block of windows,
    ``S`` the curvature.
    """

    points: np.ndarray
    periodic: bool
    G: np.ndarray
    g: np.ndarray
    S: np.ndarray

    def solved(self, weight: np.ndarray, stiffness: float) -> np.ndarray:
        """Values at the points, with these weights of the blocks."""
        return solve(self.system(weight, stiffness), weight @ self.g, assume_a="pos")

    def system(self, weight: np.ndarray, stiffness: float) -> np.ndarray:
        H = np.tensordot(weight, self.G, 1)
        size, stiff = np.trace(H), stiffness * self.S
        firm = 1e-10 + 1e-14 * np.trace(stiff)  # data at one place do not determine a straight line
        return H + size * (stiff + firm * np.eye(len(H)))

    def gain(self, values: np.ndarray, of: np.ndarray) -> np.ndarray:
        """Power that tables (tables, m) explain in each block: |r|^2 - |r - A v|^2."""
        taken = np.einsum("si,bij,sj->sb", values, self.G[of], values, optimize=True)
        return 2.0 * values @ self.g[of].T - taken


def tabulate(
    torque: np.ndarray, log: Log, counted: np.ndarray, signals: Sequence[str], *, seed: int = 0
) -> Table | None:
    """The residual torque as a smooth function of some signals.

    Minimises sum (r - f)^2 + weight int f''^2 over tables f with linear pieces (penalised
    B-splines of degree 1). Number of points and weight are chosen by cross-validation over
    folds of windows. Fewer points are preferred if that loses less than a standard error and a
    fiftieth of the gain, a table periodic over a turn if that loses less than two standard errors.

    Parameters
    ----------
    torque : (windows, length) array
        Residual torque on the resisting side, N m.
    log : Log
        Motion of the whole record.
    counted : (windows, length) int array
        Sample indices of ``torque``.
    signals : sequence of str
        "theta", "w", "t" or "u"; or "theta" or "t" with "w" for one table in each direction; the
        latter is also used for "t" with "u".
    seed : int
        Of the bootstrap.

    Returns
    -------
    Table or None
        None if no table can be made: for other signals (a function of the acceleration is an
        inertia), too few windows, or a signal that does not change.

    Notes
    -----
    The share of the residual's power is cross-validated: each fold is predicted from the others,
    and number of points and weight are chosen without it. Standard errors come from a bootstrap
    of windows, so noise that is coloured within a window does no harm. They are widened by the
    ratio of the Bayesian to the sampling variance of a penalised fit, which compensates for its
    bias (Nychka, J. American Statistical Association 83, 1988). They hold on average over the
    table, less at its sharpest peaks.
    """
    name = INSTEAD.get(tuple(signals), tuple(signals))
    if name not in KNOWN or len(torque) < 2 * FOLDS:
        return None
    cells = _cells(torque, log, counted, name)
    if not np.ptp(np.concatenate([c.x for c in cells])) > 0.0:
        return None
    power = np.array([c.r @ c.r for c in cells])
    grids = _grids(cells, name, log.motion)
    fold = np.arange(len(cells)) % FOLDS
    gain = np.zeros(len(cells))
    for k in range(FOLDS):
        own = fold == k
        grid, stiffness = _chosen(grids, ~own)
        gain[own] = grid.gain(grid.solved(1.0 * ~own, stiffness)[None], own)[0]
    grid, stiffness = _chosen(grids, np.full(len(fold), True))
    values = grid.solved(np.ones(len(fold)), stiffness)
    draws = _draws(len(fold), seed)
    error = _error(grid, stiffness, draws)
    shares = (draws @ gain) / np.maximum(draws @ power, 1e-300)
    low, high = np.percentile(shares, LEVEL)
    square = values @ grid.G.sum(0) @ values / sum(len(c.r) for c in cells)
    rows = (2, -1) if len(name) == 2 else (-1,)
    return Table(
        signals=name,
        points=grid.points,
        values=values.reshape(rows),
        error=error.reshape(rows),
        periodic=grid.periodic,
        share=float(gain.sum() / max(power.sum(), 1e-300)),
        share95=(float(low), float(high)),
        rms=float(np.sqrt(square)),
        unit=unit_for("N m", log.motion),
        windows=len(torque),
        motion=log.motion,
    )


def _cells(
    torque: np.ndarray, log: Log, counted: np.ndarray, name: tuple[str, ...]
) -> list[_Cells]:
    """Cells of each block; many windows are grouped into blocks of neighbours."""
    every = max(1, round(CELL / log.dt))
    n = torque.shape[1] // every * every

    def mean(values: np.ndarray) -> np.ndarray:
        return values[:, :n].reshape(len(values), -1, every).mean(2)

    r, x = mean(torque), mean(getattr(log, name[0])[counted])
    if name[0] == "u":  # its noise is also in the residual
        padded = np.pad(x, ((0, 0), (1, 1)), mode="edge")
        x = 0.5 * (padded[:, :-2] + padded[:, 2:])
    w = mean(log.w[counted]) if len(name) == 2 else None
    blocks = np.array_split(np.arange(len(r)), min(len(r), BLOCKS))
    return [_Cells(r[b].ravel(), x[b].ravel(), None if w is None else w[b].ravel()) for b in blocks]


def _grids(cells: Sequence[_Cells], name: tuple[str, ...], motion: str) -> list[_Grid]:
    """Tables of every size, the simplest first."""
    x = np.concatenate([c.x for c in cells])
    turning = name[0] == "theta" and wraps(x, motion)
    sizes = [n for n in SIZES if n <= len(x) // 8] or SIZES[:1]
    made = []
    for n in sizes:
        if turning:
            made.append(_grid(cells, turn(n), True))
        points = np.linspace(x.min(), x.max(), n)
        if name[0] in ("w", "u"):  # half by range, half by how often values occur
            points = 0.5 * (points + np.quantile(x, np.linspace(0.0, 1.0, n)))
        made.append(_grid(cells, points, False))
    return made


def _grid(cells: Sequence[_Cells], points: np.ndarray, periodic: bool) -> _Grid:
    seen = around if periodic else hats
    S = _around_curvature(len(points)) if periodic else _curvature(points)
    G, g = [], []
    for c in cells:
        A = seen(c.x, points)
        if c.w is not None:
            way = 0.5 * np.tanh(c.w / EPS.value)[:, None]
            A = np.hstack([(0.5 + way) * A, (0.5 - way) * A])
        G.append(A.T @ A)
        g.append(A.T @ c.r)
    S = S if cells[0].w is None else np.kron(np.eye(2), S)
    return _Grid(points, periodic, np.array(G), np.array(g), S)


def _around_curvature(n: int) -> np.ndarray:
    """As :func:`_curvature`, for n points around one turn."""
    one = np.eye(n)
    change = np.roll(one, 1, axis=1) - 2.0 * one + np.roll(one, -1, axis=1)
    return change.T @ change * float(n) ** 3


def _curvature(points: np.ndarray) -> np.ndarray:
    """S with v'S v = int f''^2, with the range as unit of length, f'' from changes of slope."""
    h = np.diff(points) / (points[-1] - points[0])
    n = len(points)
    slope = np.diff(np.eye(n), axis=0) / h[:, None]
    middle = 0.5 * (h[1:] + h[:-1])
    change = np.diff(slope, axis=0)
    return change.T @ (change / middle[:, None])


def _chosen(grids: Sequence[_Grid], seen: np.ndarray) -> tuple[_Grid, float]:
    """Grid and stiffness chosen by cross-validation within the blocks ``seen``."""
    tried = [(grid, *_tried(grid, seen)) for grid in grids]
    best = max((gain for _, gain, _ in tried), key=np.sum)
    turning = [found for found in tried if found[0].periodic]
    around = max((gain for _, gain, _ in turning), key=np.sum, default=None)
    if around is not None and np.sum(best - around) <= 2.0 * _uncertain((best - around)[seen]):
        tried, best = turning, around
    for grid, gain, stiffness in tried:
        short = (best - gain)[seen]
        if short.sum() <= min(_uncertain(short), LOST * max(float(best.sum()), 0.0)):
            return grid, stiffness
    raise AssertionError("the best grid is as good as itself")


def _uncertain(short: np.ndarray) -> float:
    """Standard error of a sum over blocks."""
    return float(np.std(short, ddof=1)) * np.sqrt(len(short))


def _tried(grid: _Grid, seen: np.ndarray) -> tuple[np.ndarray, float]:
    """Cross-validated gain of each block with the best stiffness, and that stiffness."""
    fold = (np.cumsum(seen) - 1) % FOLDS
    gains = np.zeros((len(STIFFNESS), len(seen)))
    for k in range(FOLDS):
        own = seen & (fold == k)
        others = 1.0 * (seen & ~own)
        gains[:, own] = grid.gain(np.array([grid.solved(others, s) for s in STIFFNESS]), own)
    best = int(np.argmax(gains.sum(axis=1)))
    return gains[best], STIFFNESS[best]


def _draws(blocks: int, seed: int) -> np.ndarray:
    """Number of times that each block is drawn, (draws, blocks)."""
    index = np.random.default_rng(seed).integers(0, blocks, (DRAWS, blocks))
    return np.array([np.bincount(row, minlength=blocks) for row in index], dtype=float)


def _error(grid: _Grid, stiffness: float, draws: np.ndarray) -> np.ndarray:
    """Standard error of the values at the points."""
    drawn = np.array([grid.solved(weight, stiffness) for weight in draws])
    whole = np.ones(draws.shape[1])
    inverse = np.linalg.inv(grid.system(whole, stiffness))
    G = np.tensordot(whole, grid.G, 1)
    widened = np.diag(inverse) / np.maximum(np.diag(inverse @ G @ inverse), 1e-300)
    return np.std(drawn, axis=0, ddof=1) * np.sqrt(np.maximum(widened, 1.0))
