"""From coefficients to parameters: values, gradients, which are certain, and certain sums."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.block import unit_for
from ...blocks.model import Model
from ...core.numeric import rms
from ...estimates.findings import Estimate
from .constants import KNOWN_INERTIA, LITTLE, MOST_PARTS, QUARTER, SMALL
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
FRICTION = ("Fc", "Fv", "constant_torque")
TORQUES_FIRST = ("Fc", "constant_torque", "gravity.sin", "gravity.cos", "Fv", "slope", "J")
SPOKEN = {"gravity.sin": "gravity at 90 deg", "gravity.cos": "gravity at 0 deg"}
ANGLES = "other angles"
SEPARATE = {
    "J": "faster changes of speed",
    "Fv": "other speeds",
    "constant_torque": "the other direction",
    "gravity.sin": ANGLES,
    "gravity.cos": ANGLES,
    "slope": ANGLES,
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
        half = self.half(V, quantile)
        low = self.value - half
        low = max(low, 0.0) if self.key.endswith(".amplitude") else low
        return Estimate(float(self.value), self.unit, (float(low), float(self.value + half)))

    def is_certain(self, half: float, torque: float) -> bool:
        """Half-width below 5 % of the torque or a quarter of the value; a phase to a quarter
        rad; an inertia to half of itself, because gains and feedforward follow from it."""
        if self.angle:
            return half < QUARTER
        if self.key == "J":
            return half < KNOWN_INERTIA * abs(self.value)
        small = half * self.torque < SMALL * torque
        return small or half < QUARTER * abs(self.value)


def answers(made: Fit, model: Model, uses: Sequence[Use]) -> list[Answer]:
    """All parameters of a fit, in the order of the contract."""
    blocks = {part.block.name: part.key for part in model.effects}
    units = {key: unit_for(unit, model.motion) for key, unit in UNITS.items()}
    found = [a for key in units for a in own(made, key, key, units[key])]
    found += _wave(made, "gravity", units["Fc"])
    if made.setting.delay_prior:
        along = np.eye(len(made.p))[len(made.terms)]
        keys = ["u_delay", *([f"{blocks[DELAY]}.delay"] if DELAY in blocks else [])]
        found += [Answer(k, made.delay, along, "s", rms(made.windows.du[:, 0])) for k in keys]
    if "constant_torque" in blocks:
        found += own(made, "constant_torque", f"{blocks['constant_torque']}.torque", units["Fc"])
    elif "coulomb_asymmetry" in blocks:  # a constant torque while the drive moves
        ratio = own(made, "constant_torque", f"{blocks['coulomb_asymmetry']}.ratio", "1")
        found = [a for a in found if a.key != "constant_torque"]
        found += [_over(made, a, "Fc") for a in ratio]
    return [*found, *(a for use in uses for a in _declared(made, use, model))]


def own(made: Fit, name: str, key: str, unit: str) -> list[Answer]:
    """A coefficient as it is, if it is one, under a key."""
    if name not in made.names:
        return []
    i = made.names.index(name)
    return [Answer(key, made.p[i], np.eye(len(made.p))[i], unit, made.rms[i])]


def _wave(
    made: Fit, prefix: str, unit: str, gain: str = "amplitude", phase: str = "phase"
) -> list[Answer]:
    """A sin(x + phi) from A cos(phi) sin(x) + A sin(phi) cos(x)."""
    if f"{prefix}.sin" not in made.names:
        return []
    i, k = made.names.index(f"{prefix}.sin"), made.names.index(f"{prefix}.cos")
    a, b = made.p[i], made.p[k]
    e, f = np.eye(len(made.p))[[i, k]]
    size, torque = float(np.hypot(a, b)) + 1e-300, rms(made.rms[[i, k]])
    angle, turned = float(np.arctan2(b, a)), (a * f - b * e) / size**2
    return [
        Answer(f"{prefix}.{gain}", size, (a * e + b * f) / size, unit, torque),
        Answer(f"{prefix}.{phase}", angle, turned, "rad", size * torque, True),
    ]


def _declared(made: Fit, use: Use, model: Model) -> list[Answer]:
    """The parameters of a declared effect."""
    key, gain = use.part.key, str(use.part.block.gain)
    name, unit = f"{key}.{gain}", model.unit(f"{key}.{gain}")
    found = _wave(made, key, unit, gain, use.phase) if use.phase else own(made, name, name, unit)
    if found and use.per is not None:  # relative to a level of friction
        found[0] = _over(made, found[0], use.per)
    return found


def _over(made: Fit, a: Answer, level: str) -> Answer:
    """An answer divided by a level of friction."""
    size = made.value(level) or 1e-300
    gradient = a.gradient / size
    if level in made.names:
        gradient[made.names.index(level)] -= a.value / size**2
    return replace(a, value=a.value / size, gradient=gradient, torque=abs(size) * a.torque)


def combinations(
    made: Fit, V: np.ndarray, quantile: float, uncertain: Sequence[str], motion: str
) -> list[Combination]:
    """Sums of uncertain terms that are certain: eigenvectors of their covariance in torque."""
    at = [i for i, name in enumerate(made.names) if name in TORQUES_FIRST and name in uncertain]
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
    at = sorted(at, key=lambda i: TORQUES_FIRST.index(made.names[i]))
    size, own = made.rms[at], V[np.ix_(at, at)]
    _, E = np.linalg.eigh(own * np.outer(size, size))
    found = []
    for e in E.T:
        c = np.where(np.abs(e) < LITTLE, 0.0, e) * size
        parts = np.flatnonzero(c).tolist()
        if not 1 < len(parts) <= MOST_PARTS:
            continue
        first = parts[0]
        c = _simple(c / c[first], own)
        value = float(c @ made.p[at])
        half = quantile * float(np.sqrt(max(c @ own @ c, 0.0)))
        share = half / float(np.linalg.norm(c / size)) / made.torque
        if share > SMALL and half > QUARTER * abs(value):
            continue
        if half > abs(value) and half * size[first] > SMALL * made.torque:
            continue  # neither its size nor its sign is known
        order = [first, *sorted(parts[1:], key=lambda i: at[i])]
        named = {made.names[at[i]]: float(c[i]) for i in order}
        text, wants = said_of(named)
        unit = unit_for(UNITS.get(made.names[at[first]], "N m"), motion)
        found.append(Combination(text, value, unit, (value - half, value + half), wants, named))
    return found


def _simple(c: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Coefficients near 1 or -1 as such, where that costs little certainty."""
    simple = np.where(np.abs(np.abs(c) - 1) < SMALL, np.sign(c), c)
    return simple if simple @ V @ simple < 2 * (c @ V @ c) else c


def said_of(parts: Mapping[str, float]) -> tuple[str, str]:
    """ "Fc + 10.5 Fv - constant_torque", and what to record to separate its parts."""
    said = []
    for name, c in parts.items():
        factor = "" if abs(abs(c) - 1) < 2e-3 else f"{abs(c):.3g} "
        said.append(f"{'-' if c < 0 else '+'} {factor}{SPOKEN.get(name, name)}")
    what = " and ".join(dict.fromkeys(SEPARATE[name] for name in parts if name in SEPARATE))
    return " ".join(said).removeprefix("+ "), f"record {what or 'other speeds'}"
