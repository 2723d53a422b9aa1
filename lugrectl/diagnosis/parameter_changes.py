"""Parameter changes: fitted values far from the declared ones, and what in a drive acts so."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..blocks.model import Model
from ..core.display import with_interval
from ..estimates.findings import AGAINST_HELD, Estimate
from ..identification.likelihood.maximise import Fitted, fit
from ..identification.likelihood.parameters import is_instant

FAR = 0.2  # of the declared value, from which a change may have the causes below
ALIKE = 0.05  # relative spread within which factors count as equal
SCALED = ("J", "Fc", "Fv")  # among the values that a wrong scale of the torque multiplies
MOVED = "{} is {} [{}], declared {:.6g}"
LEFT = "The record moves declared values beyond their 95 % intervals: {}."
AT_BOUND = "{} lies at its declared {} = {:.6g}: without it the fit would go farther."
HELD_AT = "{} is held at {:.4g}, but would be {:.4g}{} if it alone were fitted, too"
CONTRADICTS = AGAINST_HELD + ": {}."
CONTRADICTED = 20.0  # gain in log-likelihood by one more value, from which this is said
STEPS = 12  # of the fit of such a value
SCALE = (
    "all by the factor {:.3g}: if the declared values are right, the scale of u is wrong (torque "
    "constant, gear ratio)"
)
DEAD_ZONE = (
    "if the declared values are right, check the actuator, too: while u and w have the same sign, "
    "its dead zone acts like Fc; record braking by the torque to distinguish them"
)


def far_off(found: Mapping[str, Estimate], declared: Model) -> list[str]:
    """A sentence on the declared values that lie outside the intervals of an answer, with both
    values, and what could be the cause of large changes.

    ``found`` are the values of the answer's own table. The error of a declared value is unknown:
    whether the drive changed must be judged by who declared it.
    """
    left = _left(found, declared)
    if not left:
        return []
    said = [_moved(key, found[key], declared) for key in left]
    factors = {
        key: ratio
        for key in (*SCALED, "Fs")
        if key in left and abs((ratio := found[key].value / left[key]) - 1.0) > FAR
    }
    return [LEFT.format("; ".join([*said, *_like(factors)]))]


def at_bounds(fitted: Fitted) -> list[str]:
    """A sentence for each value that lies at a bound that the model states."""
    made = []
    for c in fitted.free:
        value = fitted.values[c.key]
        ends = {"min": c.stuck(value, -1.0), "max": c.stuck(value, 1.0)}
        made += [AT_BOUND.format(c.key, end, value) for end, at in ends.items() if at]
    return made


def against_held(fitted: Fitted) -> list[str]:
    """A sentence on held values that the record contradicts: each alone is fitted as well."""
    predictor, said = fitted.predictor, []
    model, declared = predictor.model, predictor.declarations()
    for key in sorted(model.held() & {k for k, p in declared.items() if p.fitted}):
        if declared[key].choices or is_instant(declared[key]):
            continue
        loose = {k: one for k, one in model.stated.items() if k != key}
        free = [*(c.key for c in fitted.free), *fitted.instants, key]
        freed = fit(
            predictor.like(replace(model, stated=loose)), fitted.values, free,
            fitted.where, fitted.noise, anchor=fitted.anchor, most=STEPS, rough=True,
        )  # fmt: skip
        ends = freed.intervals().get(key)
        held, value = fitted.values[key], freed.values[key]
        clear = ends is not None and not ends[0] <= held <= ends[1]
        if clear and freed.total > fitted.total + CONTRADICTED:
            unit = model.unit(key)
            said.append(HELD_AT.format(key, held, value, "" if unit == "1" else f" {unit}"))
    return [CONTRADICTS.format("; ".join(said))] if said else []


def _moved(key: str, estimate: Estimate, declared: Model) -> str:
    """ "J is 0.0022 [0.0021, 0.0023] kg m2, declared 0.002"."""
    shown, interval = with_interval(estimate)
    unit = declared.unit(key)
    said = MOVED.format(key, shown, interval.replace(" to ", ", "), declared.values()[key])
    return said if unit == "1" else f"{said} {unit}"


def _left(found: Mapping[str, Estimate], declared: Model) -> dict[str, float]:
    """The declared values, without the held ones, that the fit left beyond their intervals."""
    declarations, made = declared.declarations(), {}
    for key, old in declared.known().items():
        ends = found[key].ci95 if key in found else None
        if ends is None or not math.isfinite(old) or key in declared.held():
            continue
        low, high = ends
        same = [old]
        if declarations[key].angle:  # full turns are the same angle
            same = [old + 2.0 * np.pi * n for n in (-1, 0, 1)]
        if not any(low <= one <= high or _alike(one, found[key].value) for one in same):
            made[key] = old
    return made


def _alike(declared: float, fitted: float) -> bool:
    """Whether both print the same: a smaller difference is no news."""
    return f"{declared:.3g}" == f"{fitted:.3g}"


def _like(factors: dict[str, float]) -> list[str]:
    """Known causes of such changes."""
    scaled = np.array([factors.get(key, 0.0) for key in SCALED])
    if scaled.all() and np.ptp(scaled) < ALIKE * scaled.mean():
        return [SCALE.format(scaled.mean())]
    return [DEAD_ZONE] if factors.get("Fc", 0.0) > 1.0 else []
