"""Random-effects regression: friction and effects fitted to a map by weighted least squares.

``u = F(w) + mean r(w, theta)`` at every point, without inertia. The variance of a point is that of
its mean plus a run-to-run variance, the same for all, estimated from the misfit (Paule and Mandel,
1982). Where the runs pass parts of a turn, the differences in each run are fitted as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares, root_scalar
from scipy.stats import t as student

from ..blocks.block import Block
from ..blocks.model import Model, Part
from ..core.numeric import rms
from ..identification.likelihood.maximise import flat
from ..identification.likelihood.parameters import (
    Coordinate,
    coordinates,
    free_keys,
    inside,
    known,
    missed,
    stated_cost,
    weak,
)
from ..identification.likelihood.predictor import Predictor, Values
from ..identification.unknown_torque.discrepancy import inverse
from .path import CELLS
from .points import Points, laid

ROUNDS = 6  # of weights and values in turn, at most
SETTLED = 0.02  # relative change of the weights that ends them
FIRST, LAST = 15, 40  # steps from every start, and of a fit: what a map hardly shows moves for ever
GUESS = 0.02  # of the torque, for its standard deviation before anything is fitted
STARTS = 2  # best starts that are followed to the end
FLAT = 1e-6  # of the scaled information, below which a direction is not identified
NUDGE = 1e-3  # step of a coordinate, to see whether the map identifies it


@dataclass(frozen=True)
class Curve:
    """A model fitted to points; ``sigma`` is the standard deviation of each.

    Plant values stay within a factor of ``anchor``; those of ``opened`` were guessed, not
    declared, and those ``apart`` are not fitted. ``rival``: a larger model that chance has not
    refuted; the intervals hold what it says by how likely it is.
    """

    predictor: Predictor
    at: Points
    values: dict[str, float]
    coords: tuple[Coordinate, ...]
    sigma: np.ndarray
    anchor: dict[str, float]
    opened: frozenset[str] = frozenset()
    apart: tuple[str, ...] = ()
    rival: Curve | None = None

    @property
    def model(self) -> Model:
        return self.predictor.model

    @property
    def residual(self) -> np.ndarray:
        """Torque that the model does not explain at the points, N m."""
        return self.left(self.values)[: len(self.at.w)]

    def left(self, values: Values) -> np.ndarray:
        """What these values do not explain: of the means, and of the differences in the runs."""
        return self.at.rows(self.predictor.torque(values))

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the means, from what differs in the runs unexplained, N m."""
        if not self.at.over_angle:
            return self.at.error
        apart = self.left(self.values).reshape(CELLS, -1)[1:]
        return np.sqrt(np.mean(apart**2, axis=0) / CELLS)

    @property
    def friction(self) -> np.ndarray:
        """Torque of the friction law at the points, N m."""
        return self.at.rows(self.predictor.friction(self.values))[: len(self.at.w)]

    def cost(self, sigma: np.ndarray) -> float:
        """Sum of squared misfits in units of ``sigma``."""
        return float(np.sum((self.left(self.values) / sigma) ** 2))

    def gains(self, after: Curve) -> np.ndarray:
        """By how much another model is better at each point, in its variances."""
        gains = (self.left(self.values) ** 2 - after.left(after.values) ** 2) / after.sigma**2
        return gains.reshape(-1, len(self.at.w)).sum(axis=0)

    @property
    def misfit(self) -> float:
        """Twice the negative log-likelihood, up to a constant."""
        prior = 2.0 * stated_cost(self.coords, self.values)
        return self.cost(self.sigma) + 2.0 * float(np.sum(np.log(self.sigma))) + prior

    def torque(self, w: np.ndarray) -> np.ndarray:
        """The model's torque at other speeds, N m, without what depends on the angle."""
        zero, nowhere = np.zeros_like(w), np.full(len(w), None)
        at = Points(w, zero, zero, zero, zero, nowhere)
        return -self.on(at).left(self._at_any_angle)

    @property
    def without_angle(self) -> np.ndarray:
        """u at the points without what depends on the angle, N m."""
        other = self.left(self._at_any_angle)[: len(self.at.w)]
        return self.at.u + self.residual - other

    @property
    def _at_any_angle(self) -> dict[str, float]:
        parts = [part for part in self.model.effects if hangs_on_angle(part.block)]
        return self.values | dict(_off(part) for part in parts)

    def on(self, at: Points) -> Curve:
        """The same model and values on other points."""
        return replace(self, predictor=self.predictor.on(laid(at, self.model.motion)), at=at)

    def missed(self, at: Points) -> np.ndarray:
        """The residual at other points."""
        return self.on(at).residual

    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals from the curvature, of identified values that are not at a bound."""
        free, x = len(self.at.w) - len(self.coords), _into(self)
        if free < 1 or not len(x):
            return {}
        covariance, made = inverse(self.information), {}
        unidentified = {key for keys in self.flat() for key in keys} | set(self.ends())
        moved = [(_at(self, x - e), _at(self, x + e)) for e in np.diag(_steps(self))]
        for c in self.coords:
            rate = np.array([b[c.key] - a[c.key] for a, b in moved]) / (2.0 * _steps(self))
            value = self.values[c.key]
            variance = rate @ covariance @ rate + self._between(c.key)
            half = float(student.ppf(0.975, free) * np.sqrt(variance))
            if c.key not in unidentified:
                low, high = self._limits(c)
                made[c.key] = (max(value - half, low), min(value + half, high))
        return made

    def _between(self, key: str) -> float:
        """Mean square of how far the rival moves a value, by its weight (Burnham and Anderson,
        Model Selection and Multimodel Inference, 2002, section 4.3)."""
        if self.rival is None:
            return 0.0
        more = 0.0  # where too few points prefer neither
        if np.isfinite(self.criterion):
            more = self.rival.criterion - self.criterion
        likely = 1.0 / (1.0 + np.exp(0.5 * more))
        return float(likely * (self.rival.values[key] - self.values[key]) ** 2)

    @property
    def criterion(self) -> float:
        """Akaike's information criterion for few points; infinite with as many values as points."""
        n, k = len(self.sigma), len(self.coords) + 1
        return self.misfit + 2.0 * k * n / (n - k - 1) if n > k + 1 else np.inf

    def _limits(self, c: Coordinate) -> tuple[float, float]:
        """The range in which a value was searched, and 0 where it may be 0: that its logarithm
        cannot reach."""
        least = self.predictor.declarations()[c.key].low
        open_ = c.kind == "log" and least == 0.0 and not c.said.bounded
        return 0.0 if open_ else c.low, c.high

    @property
    def information(self) -> np.ndarray:
        """Of the coordinates; its inverse is their covariance."""
        x = _into(self)
        slopes = np.array([_slope(self, x, i) / self.sigma for i in range(len(x))])
        return slopes @ slopes.T + known(self.coords, self.values, bounds=True)

    def flat(self) -> list[tuple[str, ...]]:
        """Keys of which the map identifies a combination only."""
        return flat(self.information, self.coords, FLAT) if self.coords else []

    def ends(self) -> tuple[str, ...]:
        """The values at a limit of their range."""
        return tuple(
            c.key
            for c in self.coords
            if c.kind == "log" and not c.low * 1.001 < self.values[c.key] < c.high / 1.001
        )

    def size(self, key: str) -> float:
        """RMS torque of an effect at the points, over that of friction."""
        without = self.values | dict([_off(self.model.part(key))])
        change = (self.left(without) - self.left(self.values))[: len(self.at.w)]
        return rms(change) / rms(self.friction)


def hangs_on_angle(block: Block) -> bool:
    """True if an effect depends on theta."""
    return "theta" in block.inputs


def _off(part: Part) -> tuple[str, float]:
    """The strength of an effect and its value at which the effect changes nothing."""
    gain = part.block.gain
    return f"{part.key}.{gain}", part.block.parameters[gain].neutral or 0.0


def fit(
    model: Model,
    at: Points,
    starts: Sequence[Values],
    anchor: Values,
    opened: frozenset[str] = frozenset(),
    apart: tuple[str, ...] = (),
) -> Curve:
    """The best fit from several starts; a value missing in ``anchor`` is anchored at its start,
    one of ``opened`` was, and one that is ``apart`` stays there."""
    opened |= {k for start in starts for k in start if k not in anchor and "." not in k}
    even = _even(at, GUESS * float(np.std(at.u)) or 1.0)
    predictor = Predictor(model, laid(at, model.motion))
    tried = []
    for start in starts:
        around = model.kept({**start, **anchor})
        keys = [key for key in free_keys(predictor) if key not in apart]
        coords = coordinates(predictor, keys, around)
        coords = [_to_zero(c) if c.key in opened else c for c in coords]
        values = inside(coords, start, model)
        open_ = Curve(predictor, at, values, (), even, around, opened, apart)
        shown = [c for c in coords if _shows(replace(open_, coords=(c,)))]
        tried.append(_stepped(replace(open_, coords=tuple(shown)), FIRST))
    best = sorted(tried, key=lambda curve: curve.misfit)[:STARTS]
    return min(map(_settled, best), key=lambda curve: curve.misfit)


def _to_zero(c: Coordinate) -> Coordinate:
    """The same down to 0, where the value may be 0: its start is a guess, no knowledge of it."""
    open_ = c.kind == "log" and c.least == 0.0 and not c.said.bounded
    return replace(c, low=0.0) if open_ else c


def _settled(curve: Curve) -> Curve:
    """Values and weights in turn."""
    for _ in range(ROUNDS):
        curve, before = _stepped(curve), curve.sigma
        curve = replace(curve, sigma=_sigma(curve))
        if np.allclose(before, curve.sigma, rtol=SETTLED):
            break
    return _stepped(curve)


def _stepped(curve: Curve, most: int = LAST) -> Curve:
    """Least squares with a weak prior, which keeps values that are not identified at their
    anchor, and with the priors that the model states."""
    if not curve.coords:
        return curve
    believed = np.sqrt(weak(curve.coords))
    center = np.array([c.into(curve.anchor) for c in curve.coords])

    def miss(x: np.ndarray) -> np.ndarray:
        values = _at(curve, x)
        torque = curve.left(values) / curve.sigma
        return np.concatenate([torque, believed * (x - center), missed(curve.coords, values)])

    done = least_squares(miss, _into(curve), x_scale="jac", max_nfev=most)
    return replace(curve, values=_at(curve, done.x))


def _even(at: Points, size: float) -> np.ndarray:
    return np.full((CELLS if at.over_angle else 1) * len(at.w), size)


def _sigma(curve: Curve) -> np.ndarray:
    """Standard deviations of the means, with the scatter from run to run, and of differences."""
    own = curve.error
    means = np.sqrt(own**2 + _scatter(curve) ** 2)
    apart = np.sqrt(CELLS) * np.maximum(own, 1e-12 * rms(curve.at.u))
    return np.concatenate([means, *[apart] * (CELLS - 1)]) if curve.at.over_angle else means


def _scatter(curve: Curve) -> float:
    """Standard deviation from run to run: what the errors of the means do not explain."""
    square, own = curve.residual**2, curve.error**2
    free = max(len(square) - len(curve.coords), 1)
    floor = 1e-4 * float(np.std(curve.at.u))
    most = float(np.sqrt(np.sum(square) / free)) + floor

    def excess(scatter: float) -> float:
        return float(np.sum(square / (own + scatter**2))) - free

    if excess(floor) <= 0.0:
        return floor
    return float(root_scalar(excess, bracket=(floor, most)).root) if excess(most) < 0.0 else most


def _into(curve: Curve) -> np.ndarray:
    return np.array([c.into(curve.values) for c in curve.coords])


def _at(curve: Curve, x: np.ndarray) -> dict[str, float]:
    made = dict(curve.values)
    for c, value in zip(curve.coords, x, strict=True):
        made[c.key] = c.back(float(value), made)
    return made


def _shows(curve: Curve) -> bool:
    """True if the map depends on the one free value at all."""
    return bool(np.any(_slope(curve, _into(curve), 0)))


def _slope(curve: Curve, x: np.ndarray, i: int) -> np.ndarray:
    """Derivative of the residual along one coordinate; one-sided at its bound."""
    c, along = curve.coords[i], _steps(curve) * (np.arange(len(x)) == i)
    ends = [_at(curve, x + s * along) for s in (-1.0, 1.0)]
    behind, ahead = (curve.left(values) for values in ends)
    apart = c.into(ends[1]) - c.into(ends[0])
    return (ahead - behind) / apart if apart else np.zeros_like(ahead)


def _steps(curve: Curve) -> np.ndarray:
    return np.array([NUDGE if c.kind in ("log", "excess") else c.step for c in curve.coords])
