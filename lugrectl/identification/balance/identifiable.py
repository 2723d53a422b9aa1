"""Which parameters are certain, and which sums of the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...blocks.block import unit_for
from .constants import (
    MOST_PARTS,
    SHARE_OF_TORQUE,
    SHARE_OF_VALUE,
    SMALL_PART,
    SNAP,
)
from .fit import Fit
from .parameters import UNITS, Answer
from .result import Combination

AMONG = ("J", "Fc", "Fv", "constant_torque", "gravity.sin", "gravity.cos", "slope")
FRICTION = ("Fc", "Fv", "constant_torque")
TORQUES_FIRST = ("Fc", "constant_torque", "gravity.sin", "gravity.cos", "Fv", "slope", "J")
SPOKEN = {"gravity.sin": "gravity at 90 deg", "gravity.cos": "gravity at 0 deg"}
SEPARATE = {
    "J": "faster changes of speed",
    "Fv": "other speeds",
    "constant_torque": "the other direction",
    "gravity.sin": "other angles",
    "gravity.cos": "other angles",
    "slope": "other angles",
}


def is_certain(a: Answer, half: float, torque: float) -> bool:
    """Half-width below 5 % of the torque or a quarter of the value; a phase to a quarter rad."""
    if a.angle:
        return half < SHARE_OF_VALUE
    return half * a.torque < SHARE_OF_TORQUE * torque or half < SHARE_OF_VALUE * abs(a.value)


def combinations(
    made: Fit, V: np.ndarray, quantile: float, uncertain: Sequence[str], motion: str
) -> list[Combination]:
    """Sums of uncertain terms that are certain: eigenvectors of their covariance in torque."""
    at = [i for i, name in enumerate(made.names) if name in AMONG and name in uncertain]
    found = _among(made, V, quantile, at, motion)
    if not found and "Fc" in uncertain:
        at = [i for i, name in enumerate(made.names) if name in FRICTION]
        found = _among(made, V, quantile, at, motion)
    return found


def _among(
    made: Fit, V: np.ndarray, quantile: float, at: Sequence[int], motion: str
) -> list[Combination]:
    if len(at) < 2:
        return []
    rms = made.rms[list(at)]
    own = V[np.ix_(at, at)]
    names = [made.names[i] for i in at]
    _, E = np.linalg.eigh(own * np.outer(rms, rms))
    found = []
    for e in E.T:
        c = np.where(np.abs(e) < SMALL_PART, 0.0, e) * rms
        if not 1 < np.count_nonzero(c) <= MOST_PARTS:
            continue
        first = min(_parts(c), key=lambda i: TORQUES_FIRST.index(names[i]))
        c = _simple(c / c[first], own)
        value = float(c @ made.p[list(at)])
        half = quantile * float(np.sqrt(max(c @ own @ c, 0.0)))
        share = half / float(np.linalg.norm(c / rms)) / made.torque
        if share > SHARE_OF_TORQUE and half > SHARE_OF_VALUE * abs(value):
            continue
        if half > abs(value) and half * rms[first] > SHARE_OF_TORQUE * made.torque:
            continue  # neither its size nor its sign is known
        text, wants = _text(c, names, first)
        unit = unit_for(UNITS.get(names[first], "N m"), motion)
        found.append(Combination(text, value, unit, (value - half, value + half), wants))
    return found


def _parts(c: np.ndarray) -> list[int]:
    return [int(i) for i in np.flatnonzero(c)]


def _simple(c: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Coefficients near 1 or -1 as such, where that costs little certainty."""
    simple = np.where(np.abs(np.abs(c) - 1) < SNAP, np.sign(c), c)
    return simple if simple @ V @ simple < 2 * (c @ V @ c) else c


def _text(c: np.ndarray, names: Sequence[str], first: int) -> tuple[str, str]:
    """ "Fc + 10.5 Fv - constant_torque", and what to record to separate its parts."""
    parts, wants = [], []
    for i in sorted(_parts(c), key=lambda i: i != first):
        factor = "" if abs(abs(c[i]) - 1) < 2e-3 else f"{abs(c[i]):.3g} "
        parts.append(f"{'-' if c[i] < 0 else '+'} {factor}{SPOKEN.get(names[i], names[i])}")
        wants += [SEPARATE[names[i]]] if names[i] in SEPARATE else []
    what = " and ".join(dict.fromkeys(wants)) or "other speeds"
    return " ".join(parts).removeprefix("+ "), f"record {what}"
