"""The sliding curve F(|w|) of a friction law: what a rigid drive feels between two sticks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.friction import free_level, level
from ..core.errors import InputError

if TYPE_CHECKING:
    from ..blocks.model import Model

REST = 1e-12  # rad/s, where a curve is read for a speed of 0: its limit, not the sign of 0
SHARP = 1e-15  # rad/s, the width of a smooth sign: far below REST
PROBED = np.geomspace(1e-6, 1e3, 200)  # speeds in rad/s at which a curve is compared with a line
STRAIGHT = 1e-9  # of Fs, by which a straight curve may differ from its line


@dataclass(frozen=True)
class Curve:
    """F(|w|) in N m, its limit Fs at rest, and whether it is Fs + Fv |w|."""

    torque: Callable[[Any], Any]

    @cached_property
    def Fs(self) -> float:
        return float(self.torque(np.array([REST]))[0])

    def drop(self, speed: np.ndarray) -> np.ndarray:
        """(Fs - F)/Fs: what sliding takes off the friction."""
        return 1.0 - self.torque(np.maximum(speed, REST)) / self.Fs

    @property
    def viscous(self) -> float:
        """N m s/rad, the slope of F at high speed."""
        F = self.torque(PROBED[-2:])
        return float((F[1] - F[0]) / (PROBED[-1] - PROBED[-2]))

    @cached_property
    def most(self) -> float:
        """The largest |F - Fv w|, N m."""
        return max(self.Fs, float(np.abs(self.torque(PROBED) - self.viscous * PROBED).max()))

    def is_straight(self) -> bool:
        """Whether the law is Coulomb and viscous friction alone."""
        F = self.torque(PROBED)
        return bool(np.abs(F - self.Fs - self.viscous * PROBED).max() <= STRAIGHT * abs(F[-1]))


def compensated(curve: Curve, share: float, vd: float, scale: float) -> Curve:
    """Friction that is ``scale`` times the curve, with ``share`` of the curve added to the torque:
    in proportion to the speed below ``vd``, so that nothing is added at rest.
    """

    def torque(w: Any) -> Any:
        return curve.torque(w) * (scale - share * np.minimum(1.0, w / vd))

    return Curve(torque)


def curve_of(model: Model) -> Curve:
    """The sliding curve of a model's law; a law with states slides at its level h(w) + Fv w."""
    block, values = model.friction.block, dict(model.friction.values)
    unknown = [k for k, v in {"J": model.J, **values}.items() if v is None]
    if unknown:
        raise InputError(f"{model.name}: hunting needs {', '.join(unknown)}: give a value.")
    if block.states:
        return Curve(_level_of(values, block.name))
    values |= {k: SHARP for k, p in block.parameters.items() if p.smooths}
    values = block.defaults() | values  # bound once: it is asked at each stage of each step
    return Curve(lambda w: block(w, **values)[0] + 0.0 * w)


def _level_of(v: dict[str, Any], name: str) -> Callable[[Any], Any]:
    if "Fc" not in v:
        raise InputError(f"the law {name} has states and no Fc: its sliding curve is not known.")
    Fs, vs, Fv = v.get("Fs", v["Fc"]), v.get("vs", 1.0), v.get("Fv", 0.0)
    if "delta" in v:
        return lambda w: free_level(w, v["Fc"], Fs, vs, v["delta"]) + Fv * w
    return lambda w: level(w, v["Fc"], Fs, vs) + Fv * w
