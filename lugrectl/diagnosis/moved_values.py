"""Fitted values far from the declared ones, in words, and what in a drive acts so."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..blocks.model import Model
from ..core.display import with_interval
from ..estimates.findings import Estimate

FAR = 0.2  # of the declared value, from which a change may have the causes below
ALIKE = 0.05  # relative spread within which factors count as equal
SCALED = ("J", "Fc", "Fv")  # among the values that a wrong scale of the torque multiplies
NEAR = 1e-4  # of a bound: at it
AT = "{} lies at its declared {} = {:.6g}: the record would take it further."
MOVED = "{} is {} [{}], declared {:.6g}"
LEFT = "The record moves declared values beyond their 95 % intervals: {}."
SCALE = (
    "all by the factor {:.3g}: if the declared values are right, the scale of u is wrong (torque "
    "constant, gear ratio)"
)
DEAD_ZONE = (
    "if the declared values are right, check the actuator, too: while u and w have the same sign, "
    "its dead zone acts like Fc; record braking by the torque to distinguish them"
)


def moved(found: Mapping[str, Estimate], declared: Model) -> list[str]:
    """A sentence on the declared values that lie outside the intervals of an answer, with both
    values, and what could be the cause of large changes."""
    left = _left(found, declared)
    if not left:
        return []
    said = [_said(key, found[key], declared) for key in left]
    factors = {
        key: ratio
        for key in (*SCALED, "Fs")
        if key in left and abs((ratio := found[key].value / left[key]) - 1.0) > FAR
    }
    return [LEFT.format("; ".join([*said, *_causes(factors)]))]


def at_bounds(found: Mapping[str, Estimate], declared: Model) -> list[str]:
    """A sentence for each value that lies at a bound that the model states."""
    made = []
    for key, one in declared.stated.items():
        for name, end in (("min", one.low), ("max", one.high)):
            if (
                key in found
                and end is not None
                and math.isclose(found[key].value, end, rel_tol=NEAR)
            ):
                made.append(AT.format(key, name, end))
    return made


def _said(key: str, estimate: Estimate, declared: Model) -> str:
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
        turns = (-1, 0, 1) if declarations[key].angle else (0,)  # full turns are the same angle
        same = [old + 2.0 * np.pi * n for n in turns]
        if not any(ends[0] <= x <= ends[1] or _alike(x, found[key].value) for x in same):
            made[key] = old
    return made


def _alike(declared: float, fitted: float) -> bool:
    """Whether both print the same: a smaller difference is no news."""
    return f"{declared:.3g}" == f"{fitted:.3g}"


def _causes(factors: dict[str, float]) -> list[str]:
    """Known causes of such changes."""
    scaled = np.array([factors.get(key, 0.0) for key in SCALED])
    if scaled.all() and np.ptp(scaled) < ALIKE * scaled.mean():
        return [SCALE.format(scaled.mean())]
    return [DEAD_ZONE] if factors.get("Fc", 0.0) > 1.0 else []
