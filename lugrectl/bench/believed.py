"""What a result, or the report of one, knows of its drive."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import InputError, Refused
from ..estimates.fitted import Fitted
from ..estimates.members import Belief, refuse_unknown
from ..record import Record
from ..simulation.recorded_sensing import sensing_of
from .reference import speed_of


def believed(p: Any) -> tuple[tuple[Belief, ...], Mapping[str, Any]]:
    """The models with their distributions, and the drive as it was recorded, of a result or of its
    report.json; Refused where a value is not known."""
    if isinstance(p, Fitted):
        if p.model is None:
            raise Refused("the record was refused, so that there is no model to compensate with.")
        return _sure(p.beliefs()), seen_in(p.record, p.torque_noise)
    what = "p"
    if isinstance(p, (str, Path)):
        what = str(p)
        try:
            p = json.loads(Path(p).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{p}: cannot be read ({error.strerror or error}).") from None
        except ValueError as error:
            raise InputError(f"{p}: not a JSON document ({error}).") from None
    if not isinstance(p, Mapping) or "members" not in p or p.get("schema", 1) != 1:
        raise InputError(
            f"{what} must be a result or the report.json of one, by this version of lugrectl."
        )
    if not p["members"]:
        raise Refused("the record was refused, so that there is no model to compensate with.")
    return _sure(tuple(Belief.read(one) for one in p["members"])), p.get("drive") or {}


def seen_in(record: Record | None, torque: float | None) -> dict[str, Any]:
    """A drive as it was recorded, as under "drive" in the JSON document: rate in Hz, noise of theta
    and w and resolution of theta in SI units, random ``torque`` that no model predicts in N m, and
    the speed of the usual reference.

    A noise of theta below that of its rounding is none: a log does not tell the two apart, and
    noise that is not there would hide what rounding does to a loop.
    """
    if record is None:
        return {}
    made = sensing_of(record)
    return {
        "rate": 1.0 / made.dt,
        "resolution": made.resolution,
        "noise": made.noise if made.noise > made.resolution / np.sqrt(12.0) else 0.0,
        "speed_noise": made.speed_noise,
        "torque": torque,
        "speed": speed_of(record),
    }


def _sure(beliefs: tuple[Belief, ...]) -> tuple[Belief, ...]:
    for one in beliefs:
        refuse_unknown(one)
    return beliefs
