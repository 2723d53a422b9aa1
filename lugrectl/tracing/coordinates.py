"""The free parameters of a fit, and the coordinates in which they are stepped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..spec import P
from .data import Log
from .predictor import Predictor, Values

REACH = {"J": 2.5, "Fc": 4.0, "Fs": 4.0}  # factor by which a value may leave the declared one
FAR = 10.0  # the same for all others
ANYWHERE = 1e4  # for an effect's own, from where it started
STEPS = 1e12  # the same for strengths that may be 0, in small steps of them
HUGE = 700.0  # whose exponential is a number still
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
    """How each of the keys is stepped: positive plant parameters in their logarithm.

    Those stay within a factor of what was declared: a model that lacks an effect would send
    them anywhere to make up for it.
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
            if p.unit == "rad" and not p.angle:  # a place: within reach of the motion
                travel = np.ptp(log.theta)
                low = max(low, np.min(log.theta) - FAR * travel)
                high = min(high, np.max(log.theta) + FAR * travel)
            kind, step = "angle" if p.angle else "linear", typical(p, log)
            low, high = max(low, -STEPS * step), min(high, STEPS * step)
            made.append(Coordinate(key, kind, low, high, step))
    return made


def typical(p: P, log: Log) -> float:
    """A small step for an effect parameter, from its unit and the size of the log."""
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
    """A moment in time: the likelihood has steps in it, so it is placed, not descended."""
    return p.unit == "s" and p.grid is not None and p.low < 0.0
