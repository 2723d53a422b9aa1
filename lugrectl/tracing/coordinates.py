"""Parameter transformation: the free parameters and the coordinates in which a fit steps them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..spec import P
from .data import Log
from .predictor import Predictor, Values

REACH = {"J": 2.5, "Fc": 4.0, "Fs": 4.0}  # factor within which a value stays of the declared one
FAR = 10.0  # the same for all other plant parameters
ANYWHERE = 1e4  # the same for an effect's parameter, about its start value
STEPS = 1e12  # the same for a strength that may be 0, in steps
HUGE = 700.0  # largest argument with a finite exponential
LEAST_EXCESS = 1e-4  # of Fs over Fc, relative


@dataclass(frozen=True)
class Coordinate:
    """One free parameter and the coordinate in which it is stepped."""

    key: str
    kind: str  # "log", "excess" (Fs over Fc), "angle" or "linear"
    low: float
    high: float
    step: float

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
            return float(min(values["Fc"] * (1.0 + np.exp(min(x, 5.0))), self.high))
        if self.kind == "angle":
            return float(np.pi - (np.pi - x) % (2.0 * np.pi))
        return float(np.clip(x, self.low, self.high))


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
            kind, step = ("excess", 1e-3) if key == "Fs" else ("log", 5e-4)
            made.append(Coordinate(key, kind, low, high, step))
        elif p.low >= 0.0 and p.neutral != 0.0 and anchor[key] > 0.0:
            least = predictor.data.dt if p.unit == "s" else 1e-12
            low = max(p.low, least, anchor[key] / ANYWHERE)
            high = max(low, min(p.high, anchor[key] * ANYWHERE))
            made.append(Coordinate(key, "log", low, high, 1e-3))
        else:
            log, low, high = predictor.data.log, p.low, p.high
            if p.unit == "rad" and not p.angle:  # a position: within reach of the motion
                travel = np.ptp(log.theta)
                low = max(low, np.min(log.theta) - FAR * travel)
                high = min(high, np.max(log.theta) + FAR * travel)
            kind, step = "angle" if p.angle else "linear", typical(p, log)
            low, high = max(low, -STEPS * step), min(high, STEPS * step)
            made.append(Coordinate(key, kind, low, high, step))
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
    """All parameters that a record can identify; a count per turn is found by search alone."""
    rotary = predictor.model.motion == "rotary"
    declared = predictor.declarations()
    fixed = {k for k, p in declared.items() if p.choices or (p.whole and rotary)}
    return [k for k, p in declared.items() if p.fitted and k not in fixed]


def is_instant(p: P) -> bool:
    """True for an instant in time.

    The likelihood is not smooth in it, so it is placed by a search and not by its gradient.
    """
    return p.unit == "s" and p.grid is not None and p.low < 0.0
