"""Which column of a table is which channel: named by the user, by its role, or by a usual name;
and what the user says of the columns: names, units and factors by role."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.option_names import option
from ...core.validation import nearest, shown
from .names import ROLES, did_you_mean, fitting, split_unit, usual_names, usual_unit
from .table import Table

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
    choices = {role: _named(table, role, name) for role, name in named.items() if name}
    taken = Counter(choice.index for choice in choices.values())
    for role, choice in choices.items():
        if taken[choice.index] > 1:
            twice = f"column '{named[role]}' is given to more than one role"
            raise InputError(f"{option('columns')}: {twice}.")
    doubtful: dict[str, str] = {}  # what to say of roles that several columns may be
    said: list[str] = []
    for role in (r for r in ROLES if r not in named):
        free = [i for i in range(len(table.names)) if i not in taken]
        fits, implied = fitting(table.plain, role, free)
        if len(fits) > 1:
            among = _among(table, role, fits)
            if not _same(table, fits):
                doubtful[role] = among
                continue
            said.append(f"{among}; they hold the same values.")
        if fits:
            choices[role] = Choice(role, fits[0], implied)
    _complete(table, choices, doubtful, need_time)
    said += [f"{among}; it was left out." for among in doubtful.values()]
    missing = next((r for r in ("w", "theta") if r not in {*choices, *doubtful, *named}), None)
    unused = _unused(table, choices.values())
    if not {"w", "theta"} & set(named) and missing and unused:  # its name may be misspelt
        given = option("columns", f"{missing}=NAME")
        start = f"No column was found for {missing}; not used: {unused}."
        said.append(f"{start} If {missing} is among them, give {given}.")
    return [choices[role] for role in ROLES if role in choices], said


def _same(table: Table, fits: Sequence[int]) -> bool:
    """Whether columns that may be one role hold the same values."""
    try:
        first, *others = table.load(list(fits))[0]
    except InputError:
        return False
    return all(np.array_equal(first, other, equal_nan=True) for other in others)


def _named(table: Table, role: str, name: str) -> Choice:
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


def _complete(
    table: Table, choices: Mapping[str, Choice], doubtful: Mapping[str, str], need_time: bool
) -> None:
    """Raise InputError if a required role has no column."""
    needed = [("u",), ("w", "theta"), *([("t",)] if need_time else [])]
    missing = (roles for roles in needed if not any(role in choices for role in roles))
    roles = next(missing, None)
    if roles is None:
        return
    if not choices and not doubtful:
        raise InputError(_nothing_known(table, need_time))
    role = next((r for r in roles if r in doubtful), roles[-1])
    how = f": name the column with {option('columns', f'{role}=NAME')}"
    start = doubtful.get(role, "")
    if not start:
        words = " or ".join(f"{r} ({_WORDS[r]})" for r in roles)
        start = f"{table.source} has no column for {words}"
        taken = {choice.index for choice in choices.values()}
        free = [name for i, name in enumerate(table.names) if i not in taken and name]
        known = {name: r for r in roles for name in (r, *usual_names(r)) if len(name) > 2}
        near = ((known[n], c) for c in free if (n := nearest(c, known)) is not None)
        if found := next(near, None):
            given = option("columns", "=".join(found))
            how = f". If '{found[1]}' is {found[0]}, rename it, or give {given}"
    how += f", or give {option('rate', 'HZ')}" if role == "t" else ""
    said = f"{start}; its columns are {table.listed()}{how}."
    raise InputError(f"{said} {table.hint}".rstrip())


def _nothing_known(table: Table, need_time: bool) -> str:
    """A sentence for a table whose names say nothing, with the option that names its columns."""
    roles = ["t", "u", "theta"] if need_time else ["u", "theta"]
    clear = all(table.names) and len(set(table.names)) == len(table.names)
    names = table.names if clear else [str(i + 1) for i in range(len(table.names))]
    pairs = ",".join(f"{r}={n}" for r, n in zip(roles, names, strict=False))
    said = f"{table.source} has no header (its numbers begin in {table.begins}): "
    said += "give the numbers of its columns, counted from 1"
    if table.headed:
        said = f"{table.source}: its columns are {table.listed()}, which say nothing of torque and "
        said += "motion: name them"
    return f"{said}, for instance {option('columns', pairs)}. {table.hint}".rstrip()


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


def _unused(table: Table, choices: Collection[Choice]) -> str:
    """The names of the columns that have no role; "" if all have one."""
    taken = {choice.index for choice in choices}
    left = [f"'{name}'" for i, name in enumerate(table.names) if i not in taken and name]
    return ", ".join(left[:6]) + (f" and {len(left) - 6} more" if len(left) > 6 else "")


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
