"""A plant for lanes computed at once."""

from __future__ import annotations

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict

LUGRE = {"model": "lugre", "sigma0": 100.0, "sigma1": 0.1, "Fc": 0.1, "Fs": 0.15, "Fv": 0.01,
         "vs": 0.01}  # fmt: skip
FRICTION = {"lugre": LUGRE, "coulomb": {"model": "coulomb", "Fc": 0.1, "Fv": 0.01}}
# a sine with a cosine, a power, least and most, a hyperbolic tangent, time
EFFECTS = {
    "gravity": {"amplitude": 0.05, "phase": 0.3},
    "sublinear_viscous": {"coefficient": 0.02, "exponent": 0.5},
    "actuator_saturation": {"limit": 0.2},
    "return_spring": {"stiffness": 0.1, "rest": 0.1},
    "thermal_drift": {"ratio": 0.3, "time_constant": 0.05},
}
WIDE = [None, *EFFECTS]


def plant(law: str, effect: str | None = None):
    model = model_from_dict({"plant": {"J": 1e-3}, "friction": FRICTION[law]}, "drawn")
    return lg.plant(model.with_effect(effect, EFFECTS[effect]) if effect else model)
