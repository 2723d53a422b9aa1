"""Which column is which channel, and its unit: by what its header says and by what the user says:
names, units and factors by role."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.errors import InputError
from ...core.option_names import option
from ...core.unit_names import si_unit
from ...core.validation import nearest, shown

if TYPE_CHECKING:
    from .table import Table

# ---- units -----------------------------------------------------------------------


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
    ("raw", None): dict.fromkeys(("A", "mA", "V", "mV", "%", "counts", "counts/s", "eRPM"), 1.0),
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
        "eRPM": "erpm electricalrpm",
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
ROLES = tuple(_QUANTITIES)
# What a factor to SI is computed from.
_HOW = dict.fromkeys([("u", "A"), ("u", "mA")], ": the torque constant times the gear ratio")
_HOW |= dict.fromkeys([("theta", "counts"), ("w", "counts/s")], ": 2 pi / counts per turn")
_HOW |= {("w", "eRPM"): ": pi/30/PAIRS, with the pole pairs of the motor, such as pi/30/7"}


def parse_unit(text: str) -> Unit | None:
    """Return the unit that ``text`` names, or None if it is unknown."""
    bare = re.sub(r"[\s.*·⋅]", "", re.sub(r"\s+per\s+|_per_", "/", text))
    bare = bare.replace("µ", "u").replace("μ", "u").replace("⁻¹", "-1")
    bare = bare.replace("°C", "degC").replace("°", "deg")
    bare = _SPELLINGS.get(bare) or _WORDS.get(bare.lower(), bare)
    return _BARE.get(bare.lower() if bare.lower() in _ANY_CASE else bare)


def role_unit(role: str, text: str, *, scaled: bool, where: str, named: bool = False) -> Unit:
    """Return the unit ``text`` of a role, which only the column's name says where ``named``;
    InputError, which begins with ``where``, for another unit, or a raw one without a scale."""
    unit = parse_unit(text)
    if unit is None or unit.quantity not in _QUANTITIES[role]:
        names = [u.name for u in UNITS.values() if u.quantity in _QUANTITIES[role]]
        what = f"the unit '{text}' of {role} is not known{did_you_mean(text, names)}"
        what = f"{role} cannot be in {unit.name}" if unit else what
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


# ---- usual names -----------------------------------------------------------------

# By role, in lower case, first choice first, with the unit that the name alone implies.
_USUAL: dict[str, tuple[tuple[str, str | None], ...]] = {
    "t": (
        ("time zeit seconds secs", None),
        ("timestamp stamp datetime clock elapsed", None),
        ("x_value date_time date", None),
    ),
    "u": (
        ("torque force tau moment effort trq drehmoment kraft", None),
        ("current iq i_q strom motorstrom", "A"),
        ("voltage vir spannung", "V"),
    ),
    "w": (
        (
            "speed velocity vel omega qd dq dtheta theta_dot thetadot drehzahl geschwindigkeit",
            None,
        ),
        ("rpm", "rpm"),
        ("erpm", "eRPM"),
    ),
    "theta": (("position pos angle q qm phi displacement x winkel", None),),
    "temperature": (("temp", None),),
}
_LAST = {"u": {"F": "N"}, "w": {"v": None}}  # as they are written: of a linear axis
# Words that may be part of a column's name without changing its meaning.
_NEUTRAL = frozenset(
    "actual value values averaged average avg mean measured meas motor joint shaft axis drive "
    "feedback raw filtered signal signals act applied estimate estimated est encoder sensor "
    "angular present data m state states field".split()
)
_OF_TIME = frozenset("elapsed relative local system log".split())
_DEMANDED = frozenset(
    "command commanded cmd reference ref desired des target setpoint set goal demand error err "
    "limit max min std offset".split()
)
_PART, _FAR = 5, 10  # a name in a path fits less well than the name itself; a demand, still less
_LENGTHS = frozenset("x displacement".split())  # the only names that _m gives metres to


def usual_names(role: str) -> list[str]:
    return [name for names, _ in _USUAL.get(role, ()) for name in names.split()]


def usual_unit(role: str, name: str) -> str | None:
    """The unit that a usual name alone implies: A for a current."""
    last = _LAST.get(role, {}).get(name)
    found = (unit for names, unit in _USUAL.get(role, ()) if name.lower() in names.split())
    return next(found, last)


def split_unit(header: str) -> tuple[str, str | None]:
    """Split 'name [unit]' or 'name (unit)'; None without one, as in position[0] or (measured)."""
    header = header.strip()
    match = re.fullmatch(r"(.*?)(\s*)(?:\[([^\[\]]*)\]|\(([^()]*)\)|<([^<>]*)>)", header)
    if match is None:
        return header, None
    unit = (match[3] or match[4] or match[5] or "").strip()
    if unit.isdigit() and not match[2]:
        return header, None
    if unit and parse_unit(unit) is None and set(_words(unit)) <= _NEUTRAL | _DEMANDED:
        return header, None
    return match[1], unit or None


def unit_in_name(name: str) -> tuple[str, str | None]:
    """Split torque_mNm, 'angle, deg' or speedRpm into name and unit, if a channel can be in it."""
    for at in re.finditer(r"\s*[,/|]\s*|[_\s-]+|(?<=[a-z])(?=[A-Z])", name):
        plain, text = name[: at.start()], name[at.end() :]
        if not plain or not text or (text == "m" and plain.lower() not in _LENGTHS):  # measured
            continue
        roles = [role for role in ROLES if rank(plain, role) is not None]
        bare, written = re.sub(r"[\s_]", "", text).lower(), parse_unit(text)
        # as it is written, or in other upper and lower case
        alike = [u for n, u in _BARE.items() if len(bare) > 1 and n.lower() == bare]
        for unit in [written] if written else alike:
            if any(unit.quantity in _QUANTITIES[role] for role in roles):
                return plain, unit.name
    return name, None


def fitting(plain: Sequence[str], role: str, free: Sequence[int]) -> tuple[list[int], str | None]:
    """Return the columns that may be the role, best match only, and the unit they imply."""
    ranks = {i: r for i in free if (r := rank(plain[i], role)) is not None}
    if not ranks:
        return [], None
    best = min(r[0] for r in ranks.values())
    fits_best = [i for i, r in ranks.items() if r[0] == best]
    return fits_best, ranks[fits_best[0]][1]


def rank(name: str, role: str) -> tuple[tuple[int, int], str | None] | None:
    """How well a name fits a role, smaller is better, and the unit it implies; None if not. Of a
    path such as /joint_states/elbow/position its last part counts that is no word such as data."""
    whole = _rank_plain(name, role)
    if whole is not None:
        return whole
    parts = [p for p in re.split(r"[/.:]+|\[[^\]]*\]", name.strip("%_ ")) if p.strip()]
    parts = [re.sub(r"(?<=[a-z])\d+$", "", part.strip()) for part in parts]
    while len(parts) > 1 and not set(_words(parts[-1])) - _NEUTRAL:
        parts.pop()
    if not parts or parts == [name]:
        return None
    demanded = bool({word for part in parts for word in _words(part)} & _DEMANDED)
    leaf = _rank_plain(parts[-1], role)
    if leaf is None or (demanded and role != "u"):
        return None
    (tier, how), implied = leaf
    return (tier, how + (_FAR if demanded else _PART)), implied


def _rank_plain(name: str, role: str) -> tuple[tuple[int, int], str | None] | None:
    lower = name.lower()
    if name == role:
        return (-1, 0), None
    if (len(role) > 1 and lower == role) or (role in ("u", "w") and name == role.upper()):
        return (-1, 1), None
    if name in _LAST.get(role, ()):
        return (_FAR, 0), _LAST[role][name]
    rest = set(_words(name)) - _NEUTRAL - (_OF_TIME if role == "t" else frozenset())
    key = rest.pop() if len(rest) == 1 else None  # as in 'Torque actual value averaged'
    for tier, (names, unit) in enumerate(_USUAL.get(role, ())):
        if re.sub(r"[\s/]", "_", lower) in names.split():
            return (tier, 0), unit
        if key is not None and key in names.split():
            return (tier, 1), unit
    return ((0, 1), None) if len(role) > 1 and key == role else None


def _words(name: str) -> list[str]:
    """The words of a name in lower case; camelCase is split, numbers are left out."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = [re.sub(r"\d+$", "", word) for word in re.split(r"[\W_]+", spaced.lower())]
    return [word for word in words if word]


# ---- the column of each role -----------------------------------------------------

_MEANING = {"t": "time", "u": "torque", "w": "velocity", "theta": "position"}


@dataclass(frozen=True)
class Choice:
    role: str
    index: int
    implied: str | None  # unit that the column's name alone implies


def choose_columns(
    table: Table, named: Mapping[str, str], *, need_time: bool
) -> tuple[list[Choice], list[str]]:
    """Return the column of each role: named by the user, by its role, or by a usual name."""
    choices = {role: _by_name(table, role, name) for role, name in named.items() if name}
    taken = Counter(choice.index for choice in choices.values())
    for role, choice in choices.items():
        if taken[choice.index] > 1:
            twice = f"column '{named[role]}' is given to more than one role"
            raise InputError(f"{option('columns')}: {twice}.")
    doubtful: dict[str, list[int]] = {}  # roles that several columns may be
    said: list[str] = []
    for role in (r for r in ROLES if r not in named):
        free = [i for i in range(len(table.names)) if i not in taken]
        fits, implied = fitting(table.plain, role, free)
        if len(fits) > 1 and not _same(table, fits):
            doubtful[role] = fits
        elif fits:
            choices[role] = Choice(role, fits[0], implied)
            said += [f"{_among(table, role, fits)}; they hold the same values."] * (len(fits) > 1)
    needed = [("t",)] * need_time + [("u",), ("w", "theta")]
    missing = [roles for roles in needed if not set(roles) & set(choices)]
    if missing:
        raise _asked(table, choices, doubtful, missing)
    said += [f"{_among(table, r, fits)}; it was left out." for r, fits in doubtful.items()]
    return [choices[role] for role in ROLES if role in choices], said


def _same(table: Table, fits: Sequence[int]) -> bool:
    """Whether columns that may be one role hold the same values."""
    try:
        first, *others = table.load(list(fits))[0]
    except InputError:
        return False
    return all(np.array_equal(first, other, equal_nan=True) for other in others)


def _by_name(table: Table, role: str, name: str) -> Choice:
    wanted = {name, split_unit(name)[0]}
    fits = [i for i, column in enumerate(table.names) if column in wanted]
    fits = fits or [i for i, column in enumerate(table.plain) if column == name]
    if not fits and name.isdecimal() and 1 <= int(name) <= len(table.names):
        fits = [int(name) - 1]
    if len(fits) != 1:
        problem = "occurs twice in" if fits else "is not in"
        raise InputError(
            f"Column '{name}' for {role} {problem} {table.source}"
            f"{'' if fits else did_you_mean(name, table.names)}; its columns are {table.listed()}."
        )
    return Choice(role, fits[0], usual_unit(role, table.plain[fits[0]]))


def _asked(
    table: Table,
    choices: Mapping[str, Choice],
    doubtful: Mapping[str, list[int]],
    missing: Sequence[Sequence[str]],
) -> InputError:
    """What to do where no column was found for some of the roles that are needed."""
    taken = {choice.index for choice in choices.values()}
    free = [i for i, name in enumerate(table.names) if i not in taken]
    clear = all(table.names) and len(set(table.names)) == len(table.names)
    said, words, pairs = [], [], []
    for roles in missing:
        role = next((r for r in roles if r in doubtful), roles[-1])
        known = {name: r for r in roles for name in (r, *usual_names(r)) if len(name) > 2}
        near = ((known[n], i) for i in free if (n := nearest(table.names[i], known)) is not None)
        role, i = next(near, (role, doubtful.get(role, [*free, -1])[0]))
        free = [k for k in free if k != i]
        pairs.append(f"{role}={'NAME' if i < 0 else table.names[i] if clear else i + 1}")
        if role in doubtful:
            said.append(_among(table, role, doubtful[role]))
        else:
            words.append(" or ".join(f"{r} ({_MEANING[r]})" for r in roles))
    how = f"name them, for instance {option('columns', ','.join(pairs))}"
    how += f", or give {option('rate', 'HZ')}" if ("t",) in missing else ""
    said += [f"{table.source} has no column for {', '.join(words)}"] if words else []
    text = f"{'; '.join(said)}; its columns are {table.listed()}: {how}. {table.hint}"
    return InputError(text.rstrip())


def _among(table: Table, role: str, fits: list[int]) -> str:
    twice = len({table.names[i] for i in fits}) < len(fits)
    names = ", ".join(f"'{table.names[i]}'" + f" (column {i + 1})" * twice for i in fits)
    return f"{role} could be any of the columns {names} of {table.source}"


def usual_said(
    table: Table, choices: Sequence[Choice], named: Collection[str], taken: Mapping[str, str]
) -> list[str]:
    """A note on columns not named by their roles; ``taken`` are units that nothing states."""
    found = [
        f"{c.role} = '{table.names[c.index]}'" + (f" in {taken[c.role]}" if c.role in taken else "")
        for c in choices
        if c.role not in named and table.names[c.index] != c.role
    ]
    return [f"Columns were identified by usual names: {', '.join(found)}."] if found else []


# ---- options ---------------------------------------------------------------------


def parse_pairs(text: str, what: str) -> dict[str, str]:
    """Read 't=time,u=torque' into a dict by role; only of "columns" a value may be empty."""
    pairs: dict[str, str] = {}
    for part in re.split(r",\s*(?=\w+\s*=)", text.strip()):
        role, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not (value or what == "columns"):
            raise InputError(
                f"{option(what)}: '{part.strip()}' is not of the form role=value; "
                f"roles are {', '.join(ROLES)}."
            )
        if role in pairs:
            raise InputError(f"{option(what)}: {role} is given twice.")
        pairs[role] = value
    return by_role(pairs, what)


def by_role(given: Any, what: str) -> dict[str, str]:
    """An option that gives a text by role, as a dict; InputError names ``what``, and the role that
    may be meant by one that does not exist."""
    if isinstance(given, str):
        return parse_pairs(given, what)
    if not (given is None or isinstance(given, Mapping)):
        raise InputError(
            f"{what} must be a dict by role, such as {{'u': ...}}, or a text, u=..., "
            f"not {shown(given)}."
        )
    made = {str(role): str(value) for role, value in (given or {}).items()}
    for role in made:
        if role not in ROLES:
            known = next((r for r in ROLES if role.lower() in usual_names(r)), None)
            meant = f" ({role} is '{known}')" if known else did_you_mean(role, ROLES)
            raise InputError(
                f"{option(what)}: there is no role '{role}'{meant}; roles are {', '.join(ROLES)}."
            )
    return made


def factors(given: Any) -> dict[str, float]:
    """The option ``scale``, a number other than 0 by role, such as 0.35, 2pi/16384 or 1/7."""
    found = {}
    for role, text in by_role(given, "scale").items():
        value = 1.0
        try:
            for k, part in enumerate(text.replace(" ", "").lower().split("/")):
                for factor in re.sub(r"(?<=[\d.])pi", "*pi", part).split("*"):
                    number = np.pi if factor == "pi" else float(factor)
                    value = value / number if k else value * number
        except (ValueError, ZeroDivisionError):
            value = np.nan
        if not np.isfinite(value) or value == 0:
            raise InputError(
                f"{option('scale')}: '{text}' for {role} is not a number other than 0."
            )
        found[role] = value
    return found
