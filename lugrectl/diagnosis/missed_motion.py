"""Why an adequate model misses the motion by more than noise: what little torque it leaves, or how
the drive breaks away, which is no part of the budget."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..core.display import number

SEVERAL = 3.0  # times the noise of the sensor, for an error that wants a reason
LEFT = (
    "The torque that the budget does not explain, {0} {1}, moves the drive by up to {2} {4} in "
    "{5:g} s, so that it agrees with the error of the simulation, {3} {4}."
)
RELEASE = (
    "The torque that the budget does not explain, {0} {1}, moves the drive by {2} {4} at most in "
    "{5:g} s, and the simulation misses {3} {4}. The budget is of sliding alone: the rest comes "
    "from rests, where the instant at which the drive breaks away decides all motion after it."
)


def missed_motion(
    error: Mapping[str, Any], left: float, unit: str, values: Mapping[str, float]
) -> list[str]:
    """A sentence for an error above noise; ``left`` is the RMS of the unexplained torque."""
    missed = error["augmented"]
    if missed is None or missed <= SEVERAL * error["noise_floor"]:
        return []
    position = error["signal"] == "theta"
    most = moved(left, error["horizon"], values["J"], values.get("Fv", 0.0), position)
    said = LEFT if missed <= most else RELEASE
    shown = (number(x, 2) for x in (left, most, missed))
    torque, most_said, missed_said = shown
    return [said.format(torque, unit, most_said, missed_said, error["unit"], error["horizon"])]


def moved(torque: float, seconds: float, J: float, Fv: float, position: bool) -> float:
    """The position or the speed that a torque held for so long gives a drive that slides."""
    x = Fv * seconds / J
    if x < 1e-6:  # no friction that grows with speed
        return torque / J * (0.5 * seconds**2 if position else seconds)
    settled = -math.expm1(-x)
    return torque / Fv * (seconds * (1.0 - settled / x) if position else settled)
