"""The fit of a model to a map: levels and strengths are solved for, the other values searched.

What is left is linear in the levels of friction and the strengths of most effects. So these are
solved for beside every start of the others, all at once, and the best is followed (Golub and
Pereyra, Separable nonlinear least squares, Inverse Problems 19(2), 2003).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import root_scalar

from ..blocks.model import Model
from ..core.numeric import rms
from ..identification.likelihood.parameters import (
    LEAST_EXCESS,
    WEAK,
    Coordinate,
    coordinates,
    free_keys,
)
from ..identification.likelihood.predictor import LEVELS, Predictor, Values
from .curve import Curve, errors
from .path import CELLS
from .points import Points, laid

FALLS = 5  # speeds from half the slowest to half the fastest at which friction may fall
BEST, ROUNDS = 8, 3  # starts that are improved by steps of all values, and how often
GUESS = 0.02  # of the torque, for its standard deviation before anything is fitted
MOST = 40  # steps of a fit: what a map hardly shows moves for ever
SETTLED = 0.01  # change of the misfit, and relative one of the weights, that ends it
DAMPED = (0.0, 0.01, 0.1, 1.0, 10.0)  # of the curvature, added to it: the best step is taken
RIDGE = 1e-10  # the least that is added: what the map does not show stays where it is
NUDGE = 1e-5  # relative step of a derivative
LEAST = 1e-12  # of a value above 0


def fit(
    model: Model,
    at: Points,
    starts: Sequence[dict[str, float]],
    anchor: Values,
    opened: frozenset[str] = frozenset(),
    apart: tuple[str, ...] = (),
) -> Curve:
    """The best fit from several starts; a value missing in ``anchor`` is anchored at the first
    start, one of ``opened`` was, and one that is ``apart`` stays there."""
    opened |= {k for start in starts for k in start if k not in anchor and "." not in k}
    around = model.kept({**starts[0], **anchor})
    predictor = Predictor(model, laid(at, model.motion))
    coords = coordinates(predictor, [k for k in free_keys(predictor) if k not in apart], around)
    falls = _falls(at) if any(c.key == "vs" for c in coords) else [{}]
    every = [model.kept(start | fall) for start in starts for fall in falls]
    coords = [_opened(c, every) if c.key in opened else c for c in coords]
    search = Search(predictor, at, coords, every, around, opened)
    values, slopes, sigma = search.followed(*search.started())
    coords = tuple(c for c, shown in zip(coords, search.shown, strict=True) if shown)
    return Curve(predictor, at, values, coords, sigma, slopes, around, opened, apart)


def _falls(at: Points) -> list[dict[str, float]]:
    """Speeds at which the fall of friction is tried, besides that of the start."""
    size = np.abs(at.w)
    speeds = np.geomspace(0.5 * size.min(), 0.5 * size.max(), FALLS)
    return [{}, *({"vs": float(vs)} for vs in speeds)]


def _opened(c: Coordinate, starts: Sequence[Values]) -> Coordinate:
    """The same about all starts, and down to 0 where the value may be 0: its start is a guess, no
    knowledge of it."""
    for start in starts:
        c = c.around(start[c.key])
    open_ = c.kind == "log" and c.least == 0.0 and not c.said.bounded
    return replace(c, low=0.0) if open_ else c


class Search:
    """The free values as an array x (..., p), with the excess over Fc in place of Fs; those that
    the map does not show are not ``shown``."""

    def __init__(
        self,
        predictor: Predictor,
        at: Points,
        coords: Sequence[Coordinate],
        starts: Sequence[dict[str, float]],
        anchor: Values,
        opened: frozenset[str],
    ) -> None:
        self.predictor, self.at, self.coords, self.starts = predictor, at, coords, starts
        kinds, self.keys = np.array([c.kind for c in coords]), [c.key for c in coords]
        self.excess, self.turns = kinds == "excess", kinds == "angle"
        self.shapes = (kinds == "log") & ~np.isin(self.keys, LEVELS)
        low = [max(c.low, LEAST) if c.kind == "log" else c.low for c in coords]
        endless = self.turns & ~np.array([c.said.bounded for c in coords], dtype=bool)
        self.low = np.where(endless, -np.inf, np.where(self.excess, 0.0, low))
        self.high = np.where(endless, np.inf, [c.high for c in coords])
        self.x = np.array([self.into(start) for start in starts])
        steps = np.where(np.isin(kinds, ("linear", "angle")), [c.step for c in coords], 0.0)
        self.center = self.into(anchor)
        loose = [not c.said.std and "." not in c.key and c.key not in opened for c in coords]
        self.weak = np.array(loose) / (
            WEAK * np.array([anchor[key] or np.inf for key in self.keys])
        )
        self.steps = NUDGE * (np.max(np.abs(self.x), axis=0) + np.abs(self.center) + steps) + 1e-300

    def into(self, values: Values) -> np.ndarray:
        """The coordinates of values, inside their bounds."""
        x, Fc = np.array([values[key] for key in self.keys]), values.get("Fc", 0.0)
        x = np.where(self.excess, np.maximum(x - Fc, LEAST_EXCESS * Fc), x)
        return np.clip(x, self.low, self.high)

    def values(self, x: np.ndarray, others: Mapping[str, Any]) -> dict[str, Any]:
        """All values by name, those of x (..., p) each (..., 1)."""
        made = {**others, **dict(zip(self.keys, np.moveaxis(x, -1, 0)[..., None], strict=True))}
        for c in self.coords:
            if c.kind == "excess":
                most = c.high if c.said.bounded else np.inf  # beyond it nothing would move
                made["Fs"] = np.clip(made["Fc"] + made["Fs"], c.said.low or 0.0, most)
            elif c.kind == "angle":
                made[c.key] = np.pi - (np.pi - made[c.key]) % (2.0 * np.pi)
        return made

    def misfits(self, x: np.ndarray, others: Mapping[str, Any], sigma: np.ndarray) -> np.ndarray:
        """In standard deviations (..., rows): to the map, weakly to declared values, and to what
        is stated of them."""
        values = self.values(x, others)
        of_map = self.at.rows(self.predictor.torque(values)) / sigma
        stated = [(values[c.key] - c.mean) / c.said.std for c in self.coords if c.said.std]
        return np.concatenate([of_map, self.weak * (x - self.center), *stated], axis=-1)

    def slopes(
        self, x: np.ndarray, others: Mapping[str, Any], sigma: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """These misfits of x (sets, p), and their derivatives (sets, rows, p)."""
        moved = np.concatenate([x[None], x + np.diag(self.steps)[:, None]])
        first, *rest = self.misfits(moved, others, sigma)
        slopes = [(r - first) / h for r, h in zip(rest, self.steps, strict=True)]
        return first, np.stack(slopes, axis=-1) if slopes else np.zeros((*first.shape, 0))

    def started(self) -> tuple[np.ndarray, dict[str, float], np.ndarray]:
        """The best start, with levels and strengths solved for, then with the phases, and steps
        of all values; its other values, and standard deviations to begin with."""
        many = (CELLS if self.at.over_angle else 1) * len(self.at.w)
        sigma = np.full(many, GUESS * float(np.std(self.at.u)) or 1.0)
        x, starts, self.shown = self.x, np.array(self.starts), np.zeros(len(self.keys), dtype=bool)
        levels = ~self.shapes & ~self.turns  # a phase shows beside a strength only
        for which in (levels, ~self.shapes, *[self.shapes | True] * ROUNDS):
            others = {k: np.array([[one[k]] for one in starts]) for k in starts[0]}
            left, slopes = self.slopes(x, others, sigma)
            self.shown |= np.any(slopes[:, :many], axis=(0, 1))
            size = np.sqrt(np.sum(slopes**2, axis=1, keepdims=True)) + 1e-300
            steps = np.linalg.pinv((slopes / size)[..., which], rcond=1e-8) @ left[..., None]
            moved = x.copy()
            moved[:, which] -= steps[..., 0] / size[:, 0, which]
            moved = np.clip(moved, self.low, self.high)
            costs = np.sum(self.misfits(moved, others, sigma) ** 2, axis=-1)
            if np.all(which):  # where one step may be too long
                before = np.sum(left**2, axis=-1)
                moved = np.where((costs < before)[:, None], moved, x)
                costs = np.minimum(costs, before)
            best = np.argsort(costs)[:BEST]
            x, starts = moved[best], starts[best]
        return x[0], starts[0], sigma

    def followed(
        self, x: np.ndarray, others: dict[str, float], sigma: np.ndarray
    ) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
        """Values and weights in turn until they settle; with the derivatives of what is left, by
        the values that are shown, and its standard deviations."""
        for _ in range(MOST):
            (left,), (slopes,) = self.slopes(x[None], others, sigma)
            tried = np.array([x, *(self._stepped(x, left, slopes, much) for much in DAMPED)])
            misfits = self.misfits(tried, others, sigma)
            costs, before = np.sum(misfits**2, axis=-1), sigma
            best = int(np.argmin(costs))
            x, rest = tried[best], misfits[best, : len(sigma)] * sigma
            sigma = scatter(self.at, rest, int(np.sum(self.shown)))
            if costs[0] - costs[best] < SETTLED and np.allclose(before, sigma, rtol=SETTLED):
                break
        _, (slopes,) = self.slopes(x[None], others, sigma)
        slopes = slopes[: len(sigma)] * sigma[:, None]
        if "Fc" in self.keys and np.any(self.excess):  # Fs moves along with Fc
            slopes[:, self.keys.index("Fc")] -= slopes[:, self.keys.index("Fs")]
        values = {k: float(np.squeeze(v)) for k, v in self.values(x, others).items()}
        return values, slopes[:, self.shown], sigma

    def _stepped(
        self, x: np.ndarray, left: np.ndarray, slopes: np.ndarray, damped: float
    ) -> np.ndarray:
        """A step of least squares; a value that would leave its bounds stays there."""
        info, pull = slopes.T @ slopes, slopes.T @ left
        info = info + (damped + RIDGE) * np.diag(np.diag(info))
        step, free = np.zeros_like(x), np.any(slopes, axis=0)
        while np.any(free):
            rest = (pull + info[:, ~free] @ step[~free])[free]
            step[free] = -np.linalg.solve(info[np.ix_(free, free)], rest)
            inside = np.clip(x + step, self.low, self.high) - x
            out = free & ((x + step < self.low) | (x + step > self.high))
            if not np.any(out):
                break
            step[out], free = inside[out], free & ~out
        return x + step


def scatter(at: Points, rest: np.ndarray, fitted: int) -> np.ndarray:
    """Standard deviations of the means, with the scatter from run to run (Paule and Mandel), and
    of differences in the runs, from what is left."""
    own, square = errors(at, rest), rest[: len(at.w)] ** 2
    free = max(len(square) - fitted, 1)
    floor = 1e-4 * float(np.std(at.u))
    between = float(np.sqrt(np.sum(square) / free)) + floor

    def excess(between: float) -> float:
        return float(np.sum(square / (own**2 + between**2))) - free

    if excess(floor) <= 0.0:
        between = floor
    elif excess(between) < 0.0:
        between = float(root_scalar(excess, bracket=(floor, between)).root)
    means = np.sqrt(own**2 + between**2)
    apart = np.sqrt(CELLS) * np.maximum(own, 1e-12 * rms(at.u))
    return np.concatenate([means, *[apart] * (CELLS - 1)]) if at.over_angle else means
