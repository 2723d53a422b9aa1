"""From coefficients to parameters: values, gradients, which are certain, and certain sums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import unit_for
from ...blocks.model import Model
from ...estimates.findings import Estimate
from .constants import MOST_PARTS, SHARE_OF_TORQUE, SHARE_OF_VALUE, SMALL_PART, SNAP
from .declared import DELAY, Use
from .fit import Fit
from .result import Combination

UNITS = {
    "J": "kg m2",
    "Fc": "N m",
    "Fv": "N m s/rad",
    "constant_torque": "N m",
    "drift": "N m",
}
PLAIN = tuple(UNITS)
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


@dataclass(frozen=True, eq=False)
class Answer:
    """A parameter: value, gradient over the coefficients, unit, and the RMS torque of one unit."""

    key: str
    value: float
    gradient: np.ndarray
    unit: str
    torque: float
    angle: bool = False

    def half(self, V: np.ndarray, quantile: float) -> float:
        """Half-width of the 95 % interval."""
        return quantile * float(np.sqrt(max(self.gradient @ V @ self.gradient, 0.0)))

    def estimate(self, V: np.ndarray, quantile: float) -> Estimate:
        """The value with its interval; an amplitude is not below 0."""
        h = self.half(V, quantile)
        low = self.value - h
        if self.key.endswith(".amplitude"):
            low = max(low, 0.0)
        return Estimate(float(self.value), self.unit, (float(low), float(self.value + h)))


def answers(made: Fit, model: Model, uses: Sequence[Use]) -> list[Answer]:
    """All parameters of a fit, in the order of the contract."""
    found = [_own(made, key, unit_for(UNITS[key], model.motion)) for key in PLAIN]
    found += _wave(made, "gravity", "sin", "cos", "phase", unit_for("N m", model.motion))
    if made.setting.delay_prior:
        found += _delay(made, model)
    for part in model.effects:
        if part.block.name == "constant_torque":
            unit = unit_for(UNITS["constant_torque"], model.motion)
            found.append(_own(made, "constant_torque", unit, f"{part.key}.torque"))
    for use in uses:
        found += _declared(made, use, model)
    return _asymmetric(found, made, model)


def _asymmetric(found: list[Answer | None], made: Fit, model: Model) -> list[Answer]:
    """An asymmetry of Coulomb friction is a constant torque while the drive moves."""
    parts = {part.block.name: part for part in model.effects}
    asymmetry = parts.get("coulomb_asymmetry")
    if asymmetry is None or "constant_torque" in parts:
        return [a for a in found if a is not None]
    ratio = _ratio(made, f"{asymmetry.key}.ratio", "constant_torque", "Fc")
    return [a for a in (*found, ratio) if a is not None and a.key != "constant_torque"]


def _unit_vector(made: Fit, i: int) -> np.ndarray:
    return np.eye(len(made.p))[i]


def _own(made: Fit, key: str, unit: str, name: str | None = None) -> Answer | None:
    """A coefficient as it is."""
    if key not in made.names:
        return None
    i = made.names.index(key)
    return Answer(name or key, made.p[i], _unit_vector(made, i), unit, made.rms[i])


def _wave(
    made: Fit, prefix: str, sine: str, cosine: str, phase: str, unit: str, per: float = 1.0
) -> list[Answer]:
    """A sin(x + phi) from A cos(phi) sin(x) + A sin(phi) cos(x)."""
    if f"{prefix}.{sine}" not in made.names:
        return []
    i, k = made.names.index(f"{prefix}.{sine}"), made.names.index(f"{prefix}.{cosine}")
    a, b = made.p[i], made.p[k]
    e, f = _unit_vector(made, i), _unit_vector(made, k)
    size = float(np.hypot(a, b)) + 1e-300
    torque = float(np.hypot(made.rms[i], made.rms[k]) / np.sqrt(2))
    amplitude = Answer(f"{prefix}.amplitude", size, (a * e + b * f) / size, unit, torque)
    turned = (a * f - b * e) / size**2
    angle = Answer(f"{prefix}.{phase}", float(np.arctan2(b, a)), turned, "rad", size * torque, True)
    return [amplitude, angle]


def _delay(made: Fit, model: Model) -> list[Answer]:
    m = len(made.terms)
    torque = float(np.sqrt(np.mean(made.windows.du[:, 0] ** 2)))
    keys = ["u_delay", *(f"{p.key}.delay" for p in model.effects if p.block.name == DELAY)]
    return [Answer(k, made.delay, _unit_vector(made, m), "s", torque) for k in keys]


def _declared(made: Fit, use: Use, model: Model) -> list[Answer | None]:
    """The parameters of a declared effect."""
    key, gain = use.part.key, use.part.block.gain
    unit = model.unit(f"{key}.{gain}")
    if use.phase is None and use.per is None:
        return [_own(made, f"{key}.{gain}", unit)]
    if use.phase is None:
        return [_ratio(made, f"{key}.{gain}", f"{key}.{gain}", str(use.per))]
    found = _wave(made, key, "sin", "cos", use.phase, unit)
    if not found:
        return []
    amplitude, angle = found
    if use.per is not None:  # relative to a level of friction
        amplitude = _over(made, amplitude, use.per)
    named = Answer(f"{key}.{gain}", *_rest(amplitude), unit, amplitude.torque)
    return [named, angle]


def _rest(a: Answer) -> tuple[float, np.ndarray]:
    return a.value, a.gradient


def _ratio(made: Fit, key: str, top: str, bottom: str) -> Answer | None:
    """The quotient of two coefficients."""
    own = _own(made, top, "1", key)
    return own and _over(made, own, bottom)


def _over(made: Fit, a: Answer, level: str) -> Answer:
    """An answer divided by a level of friction."""
    size = made.value(level) or 1e-300
    gradient = a.gradient / size
    if level in made.names:
        i = made.names.index(level)
        gradient = gradient - _unit_vector(made, i) * a.value / size**2
    return Answer(a.key, a.value / size, gradient, "1", abs(size) * a.torque)


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
