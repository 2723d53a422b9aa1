"""From coefficients to the parameters of the answer, with their gradients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import unit_for
from ...blocks.model import Model
from ...results.diagnosis_result import Estimate
from .declared import DELAY, Use
from .fit import Fit

UNITS = {
    "J": "kg m2",
    "Fc": "N m",
    "Fv": "N m s/rad",
    "constant_torque": "N m",
    "drift": "N m",
}
PLAIN = tuple(UNITS)


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
