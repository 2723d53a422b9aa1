"""A record that contradicts a drive with the declared inertia, whatever else it has."""

from __future__ import annotations

from ...blocks.block import unit_for
from ..balance import UNRELATED
from ..candidates.base_model import Base, rms
from ..regression.numbers import HALF, OFF

TOO_HEAVY = (
    "Torque and acceleration contradict the declared inertia of {0:.3g} {1}: the log shows "
    "{2:.3g} {1}, less than 1/{3:g} of it. u is not the torque that causes this motion, or J or u "
    "is in another unit."
)


def contradiction(last: Base) -> str | None:
    """Why no drive is as the last model says; None if one may be."""
    record = last.record
    declared = record.declared.get("J")
    if declared and record.lighter is not None and record.J and last.J < 1.01 * record.J[0]:
        unit = unit_for("kg m2", record.motion.motion)
        return TOO_HEAVY.format(declared, unit, record.lighter, OFF)
    left = _left(last)
    return UNRELATED.format(left) if left > HALF else None  # an effect as large would be unseen


def _left(base: Base) -> float:
    """What a model leaves, as a share of the torque."""
    return rms(base.made.r) * base.view.scale.sigma / max(rms(base.y), 1e-300)
