"""The free parameters of a fit: their coordinates, and what is known of them beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.block import P
from ...blocks.declared_values import Stated
from ...blocks.model import Model
from ..dataset.dataset import Log
from .predictor import Predictor, Values

REACH = {"J": 2.5, "Fc": 4.0, "Fs": 4.0}  # factor within which a value stays of the declared one
FAR = 10.0  # the same for all other plant parameters
ANYWHERE = 1e4  # the same for an effect's parameter, about its start value
STEPS = 1e12  # the same for a strength that may be 0, in steps
CLOSE = 1e-9  # relative distance at which a value is at its bound
HUGE = 700.0  # largest argument with a finite exponential
LEAST_EXCESS = 1e-4  # of Fs over Fc, relative
WEAK = 1.5  # natural log units, prior of a plant parameter: within a factor of 4.5


@dataclass(frozen=True)
class Coordinate:
    """One free parameter and the coordinate in which it is stepped.

    ``said`` is what the model states of it; ``mean`` the declared value, where a prior is stated.
    ``low`` and ``high`` are how far the search goes; ``least`` and ``most`` bound what the value
    can be at all.
    """

    key: str
    kind: str  # "log", "excess" (Fs over Fc), "angle" or "linear"
    low: float
    high: float
    step: float
    said: Stated = Stated()
    mean: float = 0.0
    least: float = 0.0
    most: float = np.inf

    def around(self, start: float) -> Coordinate:
        """The same with room about a start far from the declared value."""
        if self.kind not in ("log", "excess") or self.said.bounded or "." in self.key:
            return self
        far = REACH.get(self.key, FAR)
        return replace(self, low=min(self.low, start / far), high=max(self.high, start * far))

    def whole(self) -> Coordinate:
        """The same over all that the value can be, farther than the search goes."""
        return replace(self, low=min(self.low, self.least), high=max(self.high, self.most))

    def ends(self, values: Values, half: float) -> tuple[float, float] | None:
        """The ends of an interval of half width ``half`` in the coordinate about the value.

        How far the search went is no knowledge of the value: an end may lie beyond. None if all
        that was searched is as likely, and nothing else bounds the value.
        """
        x = self.into(values)
        if self.kind == "angle":
            return x - half, x + half
        whole = self.whole()
        low, high = whole.back(x - half, values), whole.back(x + half, values)
        if low <= self.low and high >= self.high and not (self.least > 0.0 and self.most < np.inf):
            return None
        return low, high

    def into(self, values: Values) -> float:
        if self.kind == "log":
            return float(np.log(values[self.key]))
        if self.kind == "excess":
            return float(np.log(max(values[self.key] / values["Fc"] - 1.0, LEAST_EXCESS)))
        return values[self.key]

    def back(self, x: float, values: Values) -> float:
        if self.kind == "log":
            return float(np.clip(np.exp(min(x, HUGE)), max(self.low, 1e-12), self.high))
        if self.kind == "excess":
            least = values["Fc"] * (1.0 + np.exp(min(x, 5.0)))
            return float(min(max(least, self.said.low or 0.0), self.high))
        if self.kind == "angle":
            return self.said.clipped(float(np.pi - (np.pi - x) % (2.0 * np.pi)))
        return float(np.clip(x, self.low, self.high))

    def ahead(self, values: Values) -> float:
        """The value a small step farther, if need be beyond a stated bound of a value above 0."""
        open_ = self if not self.said.bounded else replace(self, said=Stated())
        if open_ is not self and self.kind in ("log", "excess"):
            open_ = replace(open_, low=0.0, high=np.inf)
        return open_.back(self.into(values) + self.step, values)

    def stuck(self, value: float, uphill: float) -> bool:
        """True if the value is at a stated bound, beyond which the likelihood rises."""
        low, high = self.said.low, self.said.high
        below = low is not None and uphill < 0.0 and value <= low + CLOSE * abs(low)
        above = high is not None and uphill > 0.0 and value >= high - CLOSE * abs(high)
        return below or above


def coordinates(predictor: Predictor, keys: Sequence[str], anchor: Values) -> list[Coordinate]:
    """The coordinate of each key; positive plant parameters use their logarithm.

    Plant parameters stay within a factor of their declared value: while an effect is missing from
    the model, the fit would move them anywhere to compensate for it.
    """
    declared = predictor.declarations()
    made = []
    for key in keys:
        p = declared[key]
        if "." not in key:
            far = REACH.get(key, FAR)
            low, high = max(p.low, anchor[key] / far), min(p.high, anchor[key] * far)
            kind, step = ("excess", 1e-3) if (key == "Fs" and "Fc" in anchor) else ("log", 5e-4)
            made.append(Coordinate(key, kind, low, high, step, least=p.low, most=p.high))
        elif p.low >= 0.0 and p.neutral != 0.0 and anchor[key] > 0.0:
            least = predictor.data.dt if p.unit == "s" else 1e-12
            low = max(p.low, least, anchor[key] / ANYWHERE)
            high = max(low, min(p.high, anchor[key] * ANYWHERE))
            made.append(Coordinate(key, "log", low, high, 1e-3, least=p.low, most=p.high))
        else:
            log, low, high = predictor.data.log, p.low, p.high
            if p.unit == "rad" and not p.angle:  # a position: within reach of the motion
                travel = np.ptp(log.theta)
                low = max(low, np.min(log.theta) - FAR * travel)
                high = min(high, np.max(log.theta) + FAR * travel)
            kind, step = "angle" if p.angle else "linear", typical(p, log)
            low, high = max(low, -STEPS * step), min(high, STEPS * step)
            made.append(Coordinate(key, kind, low, high, step, least=p.low, most=p.high))
    return _ordered([_stated(c, predictor.model, anchor) for c in made], anchor)


def _stated(c: Coordinate, model: Model, anchor: Values) -> Coordinate:
    """The coordinate with what the model states of its value, in place of its usual bounds."""
    said = model.stated.get(c.key)
    if said is None:
        return c
    low = c.low if said.low is None else said.low
    high = max(c.high, low) if said.high is None else said.high
    mean = model.values().get(c.key) if said.std is not None else None
    c = replace(c, low=min(low, high), high=high, said=said, mean=mean or 0.0)
    least = c.least if said.low is None else c.low
    return replace(c, least=least, most=c.most if said.high is None else high)


def _ordered(made: list[Coordinate], anchor: Values) -> list[Coordinate]:
    """The coordinates with bounds of Fc and Fs that leave no Fs below Fc."""
    own = {c.key: c for c in made}
    Fc, Fs = own.get("Fc"), own.get("Fs")
    if Fc is None or "Fs" not in anchor:
        return made
    most = Fs.high if Fs else anchor["Fs"]
    if Fs and Fs.said.high is None:
        own["Fs"] = replace(Fs, high=max(most, Fc.high))
    else:
        own["Fc"] = replace(Fc, high=min(Fc.high, most), low=min(Fc.low, most), most=most)
    return list(own.values())


def inside(coords: Sequence[Coordinate], values: Values, model: Model) -> dict[str, float]:
    """The values as a fit may start from them: held ones as declared, the others inside their
    stated bounds, Fs not below Fc."""
    made, own = model.kept(values), {c.key: c for c in coords}
    if "Fc" not in made or "Fs" not in made:
        return made
    if "Fc" in own:
        made["Fc"] = min(made["Fc"], own["Fc"].high)
    if "Fs" in own:
        made["Fs"] = max(made["Fs"], made["Fc"])
    elif "Fc" in own:
        made["Fc"] = min(made["Fc"], made["Fs"])
    return made


def rates(coords: Sequence[Coordinate], values: Values) -> np.ndarray:
    """Derivatives of the values (rows) by the coordinates (columns)."""
    made = np.eye(len(coords))
    for i, c in enumerate(coords):
        if c.kind == "log":
            made[i, i] = values[c.key]
        elif c.kind == "excess":  # Fs moves along with Fc
            made[i, i] = max(values[c.key] - values["Fc"], LEAST_EXCESS * values["Fc"])
            made[i, [q.key == "Fc" for q in coords]] = values[c.key]
    return made


def typical(p: P, log: Log) -> float:
    """A small step for an effect's parameter, from its unit and the size of the signals."""
    torque, travel = float(np.std(log.u)), float(np.ptp(log.theta))
    speed, length = float(np.max(np.abs(log.w))), float(log.t[-1] - log.t[0])
    sizes = {
        "N m": 1e-4 * torque,
        "N m/rad": 1e-4 * torque / travel,
        "N m s2/rad2": 1e-4 * torque / speed**2,
        "1/rev": 1e-3 / travel,
        "Hz": 1e-4 / length,
        "s": 0.01 * log.dt,
    }
    return sizes.get(p.unit, 1e-4)


def free_keys(predictor: Predictor) -> list[str]:
    """All parameters that a record can identify and that are not held; a count per turn is found
    by search alone."""
    rotary = predictor.model.motion == "rotary"
    declared = predictor.declarations()
    fixed = {k for k, p in declared.items() if p.choices or (p.whole and rotary)}
    fixed |= predictor.model.held()
    return [k for k, p in declared.items() if p.fitted and k not in fixed]


def is_instant(p: P) -> bool:
    """True for an instant in time.

    The likelihood is not smooth in it, so it is placed by a search and not by its gradient.
    """
    return p.unit == "s" and p.low < 0.0


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
