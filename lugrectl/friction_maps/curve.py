"""Random-effects regression: friction and effects fitted to a map by weighted least squares.

``u = F(w) + mean r(w, theta)`` at every point, without inertia. The variance of a point is that of
its mean plus a run-to-run variance, the same for all, estimated from the misfit (Paule and Mandel,
1982). Where the runs pass parts of a turn, the differences in each run are fitted as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import t as student

from ..blocks.block import Block
from ..blocks.model import Model, Part
from ..core.numeric import rms
from ..identification.likelihood.maximise import flat
from ..identification.likelihood.parameters import Coordinate, known, stated_cost
from ..identification.likelihood.predictor import Predictor, Values
from ..identification.unknown_torque.discrepancy import inverse
from .path import CELLS
from .points import Points, laid

FLAT = 1e-6  # of the scaled information, below which a direction is not identified


@dataclass(frozen=True)
class Curve:
    """A model fitted to points; ``sigma`` is the standard deviation of each.

    ``slopes`` (rows, coords) are derivatives of what is left, by the values that were fitted. Plant
    values stay within a factor of ``anchor``; those of ``opened`` were guessed, not declared, and
    those ``apart`` are not fitted. ``rivals``: larger models that were not taken, by chance or for
    being small; the intervals hold what they say by how likely they are.
    """

    predictor: Predictor
    at: Points
    values: dict[str, float]
    coords: tuple[Coordinate, ...]
    sigma: np.ndarray
    slopes: np.ndarray
    anchor: dict[str, float]
    opened: frozenset[str] = frozenset()
    apart: tuple[str, ...] = ()
    rivals: tuple[Curve, ...] = ()

    @property
    def model(self) -> Model:
        return self.predictor.model

    @property
    def residual(self) -> np.ndarray:
        """Torque that the model does not explain at the points, N m."""
        return self.rest[: len(self.at.w)]

    @cached_property
    def rest(self) -> np.ndarray:
        """What is left of the means, and of the differences in the runs."""
        return self.left(self.values)

    def left(self, values: Values) -> np.ndarray:
        """The same with other values."""
        return self.at.rows(self.predictor.torque(values))

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the means, N m."""
        return errors(self.at, self.rest)

    @property
    def friction(self) -> np.ndarray:
        """Torque of the friction law at the points, N m."""
        return self.at.rows(self.predictor.friction(self.values))[: len(self.at.w)]

    def cost(self, sigma: np.ndarray) -> float:
        """Sum of squared misfits in units of ``sigma``."""
        return float(np.sum((self.rest / sigma) ** 2))

    def gains(self, after: Curve) -> np.ndarray:
        """By how much another model is better at each point, in its variances."""
        gains = (self.rest**2 - after.rest**2) / after.sigma**2
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

    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals from the curvature, of identified values that are not at a bound."""
        free = len(self.at.w) - len(self.coords)
        if free < 1 or not self.coords:
            return {}
        unidentified = {key for keys in self.flat() for key in keys} | set(self.ends())
        variance = np.diag(inverse(self.information))
        made = {}
        for c, own in zip(self.coords, variance, strict=True):
            value, (low, high) = self.values[c.key], self._limits(c)
            half = float(student.ppf(0.975, free) * np.sqrt(own + self._between(c.key)))
            if c.key not in unidentified:
                made[c.key] = (max(value - half, low), min(value + half, high))
        return made

    def _between(self, key: str) -> float:
        """Mean square of how far rivals move a value, by their weights (Burnham and Anderson,
        Model Selection and Multimodel Inference, 2002, section 4.3)."""
        every = (self, *self.rivals)
        price = np.array([one.criterion for one in every])
        least = float(np.min(price))
        weight = np.exp(-0.5 * (price - least)) if np.isfinite(least) else np.ones(len(every))
        moved = np.array([one.values[key] - self.values[key] for one in every])
        return float(weight @ moved**2 / weight.sum())

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
        """Of the fitted values; its inverse is their covariance."""
        slopes = self.slopes / self.sigma[:, None]
        linear = [replace(c, kind="linear") for c in self.coords]
        return slopes.T @ slopes + known(linear, self.values, bounds=True)

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
        change = (self.left(without) - self.rest)[: len(self.at.w)]
        return rms(change) / rms(self.friction)


def hangs_on_angle(block: Block) -> bool:
    """True if an effect depends on theta."""
    return "theta" in block.inputs


def errors(at: Points, rest: np.ndarray) -> np.ndarray:
    """Standard errors of the means, from what differs in the runs unexplained, N m."""
    if not at.over_angle:
        return at.error
    return np.sqrt(np.mean(rest.reshape(CELLS, -1)[1:] ** 2, axis=0) / CELLS)


def _off(part: Part) -> tuple[str, float]:
    """The strength of an effect and its value at which the effect changes nothing."""
    gain = part.block.gain
    return f"{part.key}.{gain}", part.block.parameters[gain].neutral or 0.0
