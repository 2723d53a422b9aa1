"""Units of logged channels: the names understood and their factors to SI."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class Unit:
    """A unit: SI value = ``factor`` times the number in this unit.

    ``motion`` is the kind of drive the unit belongs to, None when it fits both;
    quantity "raw" has no SI meaning before the user's own scale is applied.
    """

    name: str
    quantity: str
    factor: float
    motion: str | None = None


UNITS = {
    unit.name: unit
    for unit in (
        Unit("s", "time", 1.0),
        Unit("ms", "time", 1e-3),
        Unit("us", "time", 1e-6),
        Unit("rad", "position", 1.0, "rotary"),
        Unit("deg", "position", np.pi / 180, "rotary"),
        Unit("rev", "position", 2 * np.pi, "rotary"),
        Unit("rad/s", "velocity", 1.0, "rotary"),
        Unit("deg/s", "velocity", np.pi / 180, "rotary"),
        Unit("rpm", "velocity", np.pi / 30, "rotary"),
        Unit("rev/s", "velocity", 2 * np.pi, "rotary"),
        Unit("N m", "torque", 1.0, "rotary"),
        Unit("mN m", "torque", 1e-3, "rotary"),
        Unit("m", "position", 1.0, "linear"),
        Unit("mm", "position", 1e-3, "linear"),
        Unit("um", "position", 1e-6, "linear"),
        Unit("m/s", "velocity", 1.0, "linear"),
        Unit("mm/s", "velocity", 1e-3, "linear"),
        Unit("N", "torque", 1.0, "linear"),
        Unit("A", "raw", 1.0),
        Unit("V", "raw", 1.0),
        Unit("%", "raw", 1.0),
        Unit("counts", "raw", 1.0),
        Unit("degC", "temperature", 1.0),
        Unit("K", "temperature", 1.0),
    )
}

# Other spellings, after spaces, dots and stars are removed.
_SPELLINGS = {
    "sec": "s",
    "degree": "deg",
    "degrees": "deg",
    "1/min": "rpm",
    "r/min": "rpm",
    "U/min": "rpm",
    "rps": "rev/s",
    "percent": "%",
    "count": "counts",
    "inc": "counts",
    "C": "degC",
}
# Only where upper case cannot mean something else (MN m is not mN m).
_ANY_CASE = ("rad", "deg", "rev", "rad/s", "deg/s", "rev/s", "rpm")

_QUANTITIES = {
    "t": ("time",),
    "u": ("torque", "raw"),
    "w": ("velocity", "raw"),
    "theta": ("position", "raw"),
    "r": ("position", "velocity", "raw"),
    "d": ("torque", "raw"),
    "temperature": ("temperature", "raw"),
    "theta_load": ("position", "raw"),
}
_SI = {
    "rotary": {"t": "s", "u": "N m", "w": "rad/s", "theta": "rad", "d": "N m"},
    "linear": {"t": "s", "u": "N", "w": "m/s", "theta": "m", "d": "N"},
}

ROLES = tuple(_QUANTITIES)


def si_unit(role: str, motion: str) -> str:
    """Return the SI unit of a role; empty if it has none (r, temperature)."""
    return _SI[motion].get("theta" if role == "theta_load" else role, "")


def parse_unit(text: str) -> Unit | None:
    """Return the unit that ``text`` names, or None if it is unknown."""
    bare = re.sub(r"[\s.*·⋅]", "", text).replace("µ", "u").replace("μ", "u")
    bare = bare.replace("°C", "degC").replace("°", "deg")
    bare = _SPELLINGS.get(bare, bare)
    if bare.lower() in _ANY_CASE:
        bare = bare.lower()
    return next((u for name, u in UNITS.items() if name.replace(" ", "") == bare), None)


def role_unit(role: str, text: str, *, scaled: bool, where: str) -> Unit:
    """Return the unit ``text`` of a role, checked to fit the role.

    Raises InputError when the unit is unknown, measures something else, or is raw
    (A, V, %, counts) without a scale. ``where`` begins the sentence.
    """
    unit = parse_unit(text)
    if unit is None:
        names = [u.name for u in UNITS.values() if u.quantity in _QUANTITIES[role]]
        raise InputError(
            f"{where}: the unit '{text}' of {role} is not known{did_you_mean(text, names)}; "
            f"known for {role}: {', '.join(names)}."
        )
    if unit.quantity not in _QUANTITIES[role]:
        names = [u.name for u in UNITS.values() if u.quantity in _QUANTITIES[role]]
        raise InputError(
            f"{where}: {role} cannot be in {unit.name}; known for {role}: {', '.join(names)}."
        )
    if unit.quantity == "raw" and not scaled:
        raise InputError(
            f"{where}: {role} is in {unit.name}, which needs its factor to SI: "
            f"give --scale {role}=FACTOR (SI value per {unit.name})."
        )
    return unit


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ' (did you mean x?)' if the word resembles a known one, else an empty text."""
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.6)
    return f" (did you mean '{by_lower[near[0]]}'?)" if near else ""
