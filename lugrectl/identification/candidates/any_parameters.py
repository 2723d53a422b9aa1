"""An effect whose parameters are declared without a grid: where to search for them.

Units and bounds give the values to try: a position within the travel, a speed or a time within
the record, a phase all around, anything else around its default.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np
from scipy.optimize import minimize

from ...blocks.block import Block, P
from ..regression.smooth_motion import Motion
from .base_model import Base
from .candidate import Entry
from .effect_columns import columns, spanned
from .search_ranges import grid_of

MANY = (24, 9, 5, 3)  # values of each parameter, where there are 1, 2, 3 or more
BEST = 3  # of the grid that are polished
POLISH = 40  # evaluations for each parameter
WIDE = 30.0  # factor about a default, down and up


def over_all(base: Base, block: Block, free: Sequence[str]) -> Iterator[Entry]:
    """One entry: the best of a grid of all its parameters, polished together."""
    m, own = base.record.motion, block.own
    many = MANY[min(len(free), len(MANY)) - 1]
    grids = [_grid(block, k, m, many) for k in free]
    pair = spanned(block) is not None
    low, high = np.array([[own[k].low, own[k].high] for k in free]).T

    def gain(x: np.ndarray) -> float:
        if np.any(x < low) or np.any(x > high):
            return -np.inf
        made = columns(base, block, dict(zip(free, map(float, x), strict=True)), screening=True)
        if not np.all(np.isfinite(made.X)):
            return -np.inf
        if pair:
            return float(base.gains_of_pairs(made.X)[0])
        found, b = base.gains(made.X)
        return float(found[0]) if made.low[0] <= b[0] <= made.high[0] else -1.0

    places = [np.array(x) for x in product(*grids)]
    gains = np.array([gain(x) for x in places])
    if not np.any(np.isfinite(gains)):
        return
    steps = [_step(grid) for grid in grids]
    firsts = [places[i] for i in np.argsort(gains)[::-1][:BEST]]
    tries = [simplex(gain, x, steps, POLISH * len(free)) for x in firsts]
    best = max([*firsts, *tries], key=gain)
    values = dict(zip(free, map(float, best), strict=True))
    yield Entry(block.name, values, columns(base, block, values), cost=float(np.log(len(places))),
                inertial="J" in block.acts)  # fmt: skip


def _grid(block: Block, key: str, m: Motion, many: int) -> np.ndarray:
    """Values to try, within the bounds of the parameter."""
    p, tried = block.own[key], grid_of(block, key)
    if p.choices:
        return np.array(p.choices)
    if tried is not None:
        grid = np.asarray(tried(m), float)
        return grid[:: max(1, len(grid) // (4 * many))]
    if np.isfinite(p.low) and p.high - p.low <= 2 * np.pi + 1e-9 and p.unit == "rad":
        return p.low + (p.high - p.low) * (np.arange(many) + 0.5) / many
    grid = _of_unit(p, m, many)
    return np.unique(np.clip(grid, p.low, p.high))


def _of_unit(p: P, m: Motion, many: int) -> np.ndarray:
    if p.unit == "rad":
        return np.quantile(m.theta, (np.arange(many) + 0.5) / many)
    if p.unit == "rad/s":
        speeds = m.top * np.geomspace(0.003, 1.0, many)
        return speeds if p.low >= 0 else np.concatenate([-speeds[::-1], speeds])
    if p.unit == "s":
        return m.duration * np.geomspace(1e-3, 1.0, many)
    if np.isfinite(p.low) and np.isfinite(p.high) and not 0 < 100 * p.low < p.high:
        return np.linspace(p.low, p.high, many)
    size = abs(p.value) or 1.0
    sizes = size * np.geomspace(1 / WIDE, WIDE, many)
    if p.low >= 0 or p.value > 0:
        return sizes
    return np.concatenate([-sizes[::-1], sizes]) if p.value == 0 else -sizes


def _step(grid: np.ndarray) -> float:
    return 0.3 * float(np.min(np.diff(grid))) if len(grid) > 1 else 0.1 * (abs(grid[0]) or 1.0)


def simplex(
    gain: Callable[[np.ndarray], float], x: Sequence[float], step: Sequence[float], evaluations: int
) -> np.ndarray:
    """The largest gain near x, by Nelder and Mead."""
    start = np.asarray(x, float)
    corners = np.vstack([start, start + np.diag(step)])
    options = {"initial_simplex": corners, "maxfev": evaluations}
    return minimize(lambda p: -gain(p), start, method="Nelder-Mead", options=options).x
