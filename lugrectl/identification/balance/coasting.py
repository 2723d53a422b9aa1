"""A record whose torque is 0 throughout: the drive coasts, or the torque channel is dead."""

from __future__ import annotations

from dataclasses import replace

from ...blocks.block import unit_for
from .constants import MAJORITY
from .parameters import UNITS
from .result import Balance, Combination

UNIT_INERTIA = {"J": 1.0}
PER_INERTIA = {"Fc": "rad/s2", "constant_torque": "rad/s2", "Fv": "1/s"}
LINEAR = {"rad/s2": "m/s2"}


def coasting(made: Balance, motion: str) -> Balance | None:
    """The friction for each unit of inertia, from a balance with J = 1.

    None where friction does not explain how the speed changes: the torque channel is dead.
    """
    found = made.parameters
    brakes = [k for k in ("Fc", "Fv") if k in found and (found[k].ci95 or (0, 0))[0] > 0]
    if not brakes or made.left is None or made.left > MAJORITY:
        return None
    sums = [_per_inertia(k, made, motion) for k in PER_INERTIA if k in found]
    note = (
        f"u is 0 {unit_for(UNITS['Fc'], motion)} in every row, and friction explains how the speed "
        "falls: the drive coasts. Friction for each unit of inertia is certain; give J for more."
    )
    return replace(
        made,
        parameters={k: e for k, e in found.items() if k.startswith("w_")},
        uncertain={},
        combinations=tuple(sums),
        curve=(),
        notes=(*made.notes, note),
    )


def _per_inertia(key: str, made: Balance, motion: str) -> Combination:
    estimate, unit = made.parameters[key], PER_INERTIA[key]
    unit = LINEAR.get(unit, unit) if motion == "linear" else unit
    assert estimate.ci95
    return Combination(f"{key} / J", estimate.value, unit, estimate.ci95, "")
