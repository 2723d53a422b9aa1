"""Units of logged channels: the names understood and their factors to SI."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...core.errors import InputError
from ...core.option_names import option
from ...core.unit_names import si_unit
from ...core.validation import nearest


@dataclass(frozen=True)
class Unit:
    """A unit and its ``factor`` to SI; of "raw" ones, the user's own scale comes before it."""

    name: str
    quantity: str
    factor: float
    motion: str | None = None  # the kind of drive it belongs to; None: it fits both


_DEG, _TURN = np.pi / 180, 2 * np.pi
_FACTORS: dict[tuple[str, str | None], dict[str, float]] = {  # by quantity and motion
    ("time", None): {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    ("position", "rotary"): {"rad": 1.0, "mrad": 1e-3, "deg": _DEG, "rev": _TURN},
    ("velocity", "rotary"): {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": _DEG}
    | {"rpm": np.pi / 30, "rev/s": _TURN},
    ("torque", "rotary"): {"N m": 1.0, "mN m": 1e-3, "uN m": 1e-6, "kN m": 1e3}
    | {"N cm": 1e-2, "N mm": 1e-3, "kgf cm": 0.0980665, "ozf in": 0.00706155183333}
    | {"lbf in": 0.1129848290276, "lbf ft": 1.3558179483314},
    ("position", "linear"): {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    ("velocity", "linear"): {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6}
    | {"m/min": 1 / 60, "mm/min": 1e-3 / 60},
    ("torque", "linear"): {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    ("raw", None): dict.fromkeys(("A", "mA", "V", "mV", "%", "counts", "counts/s"), 1.0),
    ("temperature", None): {"degC": 1.0, "K": 1.0},
}
UNITS = {
    name: Unit(name, quantity, factor, motion)
    for (quantity, motion), factors in _FACTORS.items()
    for name, factor in factors.items()
}
_BARE = {name.replace(" ", ""): unit for name, unit in UNITS.items()}

# Other spellings, after spaces, dots and stars are removed; the words in any case.
_WORDS = {
    word: unit
    for unit, words in {
        "s": "sec second seconds secs",
        "ms": "msec millisecond milliseconds millis",
        "us": "usec microsecond microseconds micros",
        "ns": "nsec nanosecond nanoseconds nanos",
        "min": "minute minutes",
        "rad": "radian radians",
        "deg": "degree degrees degs",
        "rev": "turn turns revs revolution revolutions",
        "rad/s": "rad/sec radps rad/second rads-1 rads^-1 rad_s",
        "deg/s": "deg/sec degps dps degs-1 degs^-1 deg_s degree/s degrees/s degree/sec degrees/sec",
        "rpm": "1/min r/min u/min rev/min min-1 min^-1 turns/min",
        "rev/s": "rps rev/sec turn/s turns/s turns/sec revs/s rev_s turns_s",
        "m/s": "m_s mps m/sec",
        "mm/s": "mm_s mmps mm/sec",
        "Nm": "n-m newtonmetre newtonmeter newton-meter newton-metre n_m",
        "ozfin": "oz-in ozin ozf-in",
        "lbfin": "lb-in lbin lbf-in inlb in-lb",
        "lbfft": "lb-ft lbft lbf-ft ftlb ft-lb ft-lbf",
        "kgfcm": "kgcm kg-cm kgf-cm",
        "m": "metre meter metres meters",
        "mm": "millimetre millimeter millimetres millimeters",
        "N": "newton newtons",
        "A": "amp amps ampere amperes",
        "V": "volt volts",
        "%": "percent pct",
        "counts": "count cnt cnts cts inc incs increments tick ticks pulse pulses lsb digits",
        "counts/s": "count/s ticks/s cnt/s inc/s pulses/s",
        "degC": "celsius degc",
    }.items()
    for word in words.split()
}
_SPELLINGS = {"C": "degC", "mN-m": "mNm", "mN_m": "mNm"}
# Only where upper case cannot mean something else (MN m is not mN m).
_ANY_CASE = ("rad", "deg", "rev", "rad/s", "deg/s", "rev/s", "rpm", "mrad", "mrad/s")

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


# What a factor to SI is computed from.
_HOW = {
    ("u", "A"): ": the torque constant times the gear ratio",
    ("u", "mA"): ": the torque constant times the gear ratio",
    ("theta", "counts"): ": 2 pi / counts per turn",
    ("w", "counts/s"): ": 2 pi / counts per turn",
}

ROLES = tuple(_QUANTITIES)


def parse_unit(text: str) -> Unit | None:
    """Return the unit that ``text`` names, or None if it is unknown."""
    bare = re.sub(r"[\s.*·⋅]", "", re.sub(r"\s+per\s+|_per_", "/", text))
    bare = bare.replace("µ", "u").replace("μ", "u").replace("⁻¹", "-1")
    bare = bare.replace("°C", "degC").replace("°", "deg")
    bare = _SPELLINGS.get(bare) or _WORDS.get(bare.lower(), bare)
    return _BARE.get(bare.lower() if bare.lower() in _ANY_CASE else bare)


def fits(role: str, unit: Unit) -> bool:
    """Whether a channel of this role can be in the unit."""
    return unit.quantity in _QUANTITIES[role]


def role_unit(role: str, text: str, *, scaled: bool, where: str, named: bool = False) -> Unit:
    """Return the unit ``text`` of a role, which only the column's name says where ``named``;
    InputError, which begins with ``where``, for another unit, or a raw one without a scale."""
    unit = parse_unit(text)
    if unit is None and re.sub(r"[\W_]", "", text).lower() in ("erpm", "electricalrpm"):
        raise InputError(
            f"{where}: eRPM is the electrical speed, that of the motor times its pole pairs: give "
            f"{option('units', 'w=rpm')} and {option('scale', 'w=1/PAIRS')}, such as w=1/7."
        )
    if unit is None or not fits(role, unit):
        names = [u.name for u in UNITS.values() if fits(role, u)]
        what = f"{role} cannot be in {unit.name}" if unit else (
            f"the unit '{text}' of {role} is not known{did_you_mean(text, names)}"
        )  # fmt: skip
        raise InputError(f"{where}: {what}; known for {role}: {', '.join(names)}.")
    if unit.quantity == "raw" and not scaled:
        how, si = _HOW.get((role, unit.name), ""), si_unit(role, "rotary")
        start = f"by its name {role} is" if named else f"{role} is"
        other = f", or {option('units', f'{role}={si}')} if it is in {si}" if named else ""
        raise InputError(
            f"{where}: {start} in {unit.name}, which needs its factor to SI: "
            f"give {option('scale', f'{role}=FACTOR')} (SI value per {unit.name}{how}){other}."
        )
    return unit


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ' (did you mean x?)' if the word resembles a known one, else an empty text."""
    near = nearest(word, known)
    return f" (did you mean '{near}'?)" if near else ""
