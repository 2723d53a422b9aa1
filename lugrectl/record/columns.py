"""Which column of a table is which channel: named by the user, by its role, or by a usual name."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..errors import InputError
from .textfile import Table, split_unit
from .units import ROLES, did_you_mean

# Usual names of columns, lower case, with the unit that the name alone implies.
USUAL_NAMES: dict[str, dict[str, str | None]] = {
    "t": dict.fromkeys(("time", "zeit", "seconds"), None),
    "u": {
        **dict.fromkeys(("torque", "force", "tau", "moment", "effort", "trq"), None),
        **{"current": "A", "iq": "A", "voltage": "V", "vir": "V"},
    },
    "w": dict.fromkeys(
        ("speed", "velocity", "vel", "omega", "qd", "dq", "dtheta", "theta_dot"), None
    ),
    "theta": dict.fromkeys(
        ("position", "pos", "angle", "q", "qm", "phi", "displacement", "x"), None
    ),
    "r": {},
    "d": {},
    "temperature": {"temp": None},
    "theta_load": {},
}
# Words that may be part of a column's name without changing its meaning.
_NEUTRAL = frozenset(
    "actual value averaged average avg mean measured meas motor joint shaft axis drive "
    "feedback raw filtered signal act applied".split()
)
_WORDS = {"t": "time", "u": "torque", "w": "velocity", "theta": "position"}


@dataclass(frozen=True)
class Choice:
    role: str
    index: int
    implied: str | None  # unit that the column's name alone implies


def choose_columns(
    table: Table, named: Mapping[str, str], *, need_time: bool
) -> tuple[list[Choice], list[str]]:
    """Return the column of each role: named by the user, by its role, or by a usual name."""
    choices = {role: _named(table, role, name) for role, name in named.items()}
    taken = Counter(choice.index for choice in choices.values())
    for role, choice in choices.items():
        if taken[choice.index] > 1:
            raise InputError(f"--columns: column '{named[role]}' is given to more than one role.")
    doubtful: dict[str, list[int]] = {}
    for role in (r for r in ROLES if r not in named):
        free = [i for i in range(len(table.names)) if i not in taken]
        fits, implied = _fitting(table.names, role, free)
        if len(fits) == 1:
            choices[role] = Choice(role, fits[0], implied)
        elif fits:
            doubtful[role] = fits
    _complete(table, choices, doubtful, need_time)
    said = _usual_said(table, choices, named)
    said += [f"{_among(table, role, fits)}; it was left out." for role, fits in doubtful.items()]
    if not {"w", "theta"} & set(named):  # no note if the user named one
        said += _unused_said(table, choices, doubtful)
    return [choices[role] for role in ROLES if role in choices], said


def _named(table: Table, role: str, name: str) -> Choice:
    wanted = {name, split_unit(name)[0]}
    fits = [i for i, column in enumerate(table.names) if column in wanted]
    if len(fits) != 1:
        problem = "occurs twice in" if fits else "is not in"
        raise InputError(
            f"Column '{name}' for {role} {problem} {table.source}"
            f"{'' if fits else did_you_mean(name, table.names)}; its columns are {_list(table)}."
        )
    return Choice(role, fits[0], USUAL_NAMES[role].get(table.names[fits[0]].lower()))


def fits_role(names: Sequence[str], role: str) -> bool:
    """True if a column of these names may be the role."""
    return bool(_fitting(names, role, range(len(names)))[0])


def _fitting(names: Sequence[str], role: str, free: Sequence[int]) -> tuple[list[int], str | None]:
    """Return the columns that may be the role, best match only, and their implied unit."""
    own = [i for i in free if names[i] == role]
    if not own and len(role) > 1:
        own = [i for i in free if names[i].lower() == role]
    if not own and role in ("u", "w"):
        own = [i for i in free if names[i] == role.upper()]
    if own:
        return own, None
    usual = USUAL_NAMES[role]
    exact = [i for i in free if names[i].lower() in usual]
    if exact:
        return exact, usual[names[exact[0]].lower()]
    loose = {i: _key(names[i], usual) for i in free}
    fits = [i for i, key in loose.items() if key is not None]
    return fits, usual[loose[fits[0]] or ""] if fits else None


def _key(name: str, usual: Mapping[str, str | None]) -> str | None:
    """Return the usual name in, say, 'Torque actual value averaged'; None with unknown words."""
    words = set(re.split(r"[\W_]+", name.lower())) - {""}
    rest = words - _NEUTRAL
    return next(iter(rest)) if len(rest) == 1 and rest <= set(usual) else None


def _complete(
    table: Table,
    choices: Mapping[str, Choice],
    doubtful: Mapping[str, list[int]],
    need_time: bool,
) -> None:
    """Raise InputError if a required role has no column."""
    needed = [("u",), ("w", "theta"), *([("t",)] if need_time else [])]
    for roles in needed:
        if any(role in choices for role in roles):
            continue
        role = next((r for r in roles if r in doubtful), roles[-1])
        if role in doubtful:
            start, near = _among(table, role, doubtful[role]), ""
        else:
            words = " or ".join(f"{r} ({_WORDS[r]})" for r in roles)
            start = f"{table.source} has no column for {words}"
            known = (name for r in roles for name in (r, *USUAL_NAMES[r]) if len(name) > 2)
            near = next(filter(None, (did_you_mean(name, table.names) for name in known)), "")
        raise InputError(
            f"{start}; its columns are {_list(table)}{near}: name the column with "
            f"--columns {role}=NAME{', or give --rate HZ' if role == 't' else ''}."
        )


def _among(table: Table, role: str, fits: list[int]) -> str:
    names = ", ".join(f"'{table.names[i]}'" for i in fits)
    return f"{role} could be any of the columns {names} of {table.source}"


def _list(table: Table) -> str:
    return ", ".join(f"'{name}'" for name in table.names)


def _usual_said(table: Table, choices: Mapping[str, Choice], named: Mapping[str, str]) -> list[str]:
    taken = [
        f"{role} = '{table.names[choice.index]}'"
        for role, choice in choices.items()
        if role not in named and table.names[choice.index] != role
    ]
    return [f"Columns were identified by usual names: {', '.join(taken)}."] if taken else []


def _unused_said(
    table: Table, choices: Mapping[str, Choice], doubtful: Mapping[str, list[int]]
) -> list[str]:
    """A note on unused columns if w or theta has no column: its name may be misspelt."""
    taken = {choice.index for choice in choices.values()}
    left = [f"'{name}'" for i, name in enumerate(table.names) if i not in taken and name]
    missing = next((r for r in ("w", "theta") if r not in choices and r not in doubtful), None)
    if missing is None or not left:
        return []
    names = ", ".join(left[:6]) + (f" and {len(left) - 6} more" if len(left) > 6 else "")
    return [
        f"No column was found for {missing}; not used: {names}. If {missing} is among them, give "
        f"--columns {missing}=NAME."
    ]
