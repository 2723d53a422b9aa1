"""Prior distributions of a fit: what is known of the parameters before the record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .parameters import Coordinate, rates
from .predictor import Values

WEAK = 1.5  # natural log units, prior of a plant parameter: within a factor of 4.5


def weak(coords: Sequence[Coordinate]) -> np.ndarray:
    """Prior information on each coordinate: plant parameters are near their declared values."""
    vague = [c.kind in ("log", "excess") and c.said.std is None for c in coords]
    return np.array(vague, dtype=float) / WEAK**2


def known(coords: Sequence[Coordinate], values: Values, *, bounds: bool = False) -> np.ndarray:
    """Information of the stated priors, (coords, coords).

    With ``bounds`` two stated bounds count as the uniform distribution between them, which has
    the standard deviation (max - min) / sqrt(12).
    """
    each = [c.said.std or (_width(c) if bounds else None) for c in coords]
    size = np.array([np.inf if std is None else std for std in each])
    rows = rates(coords, values) / size[:, None]
    return rows.T @ rows


def _width(c: Coordinate) -> float | None:
    low, high = c.said.low, c.said.high
    return None if low is None or high is None else (high - low) / 12.0**0.5


def missed(coords: Sequence[Coordinate], values: Values) -> np.ndarray:
    """Distance of each value from its declared one, in stated standard deviations."""
    return np.array([(values[c.key] - c.mean) / (c.said.std or np.inf) for c in coords])


def stated_cost(coords: Sequence[Coordinate], values: Values) -> float:
    """Negative logarithm of the stated priors, up to a constant."""
    return 0.5 * float(np.sum(missed(coords, values) ** 2))


@dataclass(frozen=True)
class Prior:
    """A weak prior, which keeps directions that are not identified at the declared values, and
    the Gaussian priors that the model states."""

    coords: Sequence[Coordinate]
    center: np.ndarray
    weight: np.ndarray

    @classmethod
    def at(cls, coords: Sequence[Coordinate], values: Values) -> Prior:
        center = np.array([c.into(values) for c in coords])
        return cls(coords, center, weak(coords))

    def cost(self, values: Values) -> float:
        """Negative logarithm of the prior, up to a constant."""
        off = np.array([c.into(values) for c in self.coords]) - self.center
        return 0.5 * float(self.weight @ off**2) + stated_cost(self.coords, values)

    def pull(self, values: Values) -> tuple[np.ndarray, np.ndarray]:
        """Derivative of the prior's logarithm by the coordinates, and its information."""
        off = np.array([c.into(values) for c in self.coords]) - self.center
        size = [c.said.std or np.inf for c in self.coords]
        rows = rates(self.coords, values) / np.array(size)[:, None]
        pull = -self.weight * off - rows.T @ missed(self.coords, values)
        return pull, np.diag(self.weight) + rows.T @ rows
