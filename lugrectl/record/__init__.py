"""Measured logs: from the columns of a file to a Record in SI units on uniform time."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..checks import as_path, positive, shown
from ..errors import InputError
from ..provenance import SourceFile
from .angles import check_angles
from .arrays import FORMS, is_table, table_of
from .audit import audit, consistent, unwrapped
from .columns import Choice, choose_columns
from .readers import read_stdin, read_table
from .samples import Record
from .streams import merged
from .table import Table
from .timebase import Stamped, uniform
from .units import ROLES, Unit, did_you_mean, role_unit, si_unit

__all__ = ["Record", "consistent", "parse_pairs", "read_record"]

_FAST = {"rotary": 400.0, "linear": 20.0}  # rad/s, m/s: above, a w without unit may not be in SI


def parse_pairs(text: str, what: str) -> dict[str, str]:
    """Read 't=time,u=torque' into a dict of role to value.

    A value may contain a comma, unless a role and '=' follow it. ``what`` names the option
    ("columns", "units", "scale") in the InputError that is raised for any other text.
    """
    pairs: dict[str, str] = {}
    for part in re.split(r",\s*(?=\w+\s*=)", text.strip()):
        role, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not value:
            raise InputError(
                f"--{what}: '{part.strip()}' is not of the form role=value; "
                f"roles are {', '.join(ROLES)}."
            )
        if role in pairs:
            raise InputError(f"--{what}: {role} is given twice.")
        pairs[role] = value
    _known_roles(pairs, what)
    return pairs


def read_record(
    path: Any,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    motion: str | None = None,
) -> Record:
    """Read a measured log: text, JSON, MAT, NPY, NPZ; HDF5, Parquet, Excel with extra ``files``.

    Parameters
    ----------
    path : a path, "-" for standard input; or the columns themselves: a dict of arrays or a pandas
        DataFrame, whose names may carry units as in a file, ``w [rpm]``. If no column is t, the
        index of a DataFrame is taken for it where it holds times or is named t or time. A Record
        is returned unchanged.
    columns : role -> name of the column, or its number from 1, for columns not named by their
        role; ``rec.x[2]`` is the second column of the matrix x in the struct rec.
    units : role -> unit, in place of the unit in the header; without any unit, SI is assumed.
    scale : role -> factor on the raw value, before the unit; needed for A, V, % and counts.
    rate : sampling rate in Hz, needed when there is no t; a column of t is then not used.
    motion : "rotary" or "linear", taken from the units when not given.

    Each of the first three may be a text such as "t=time,u=torque".

    Raises
    ------
    InputError : the file or an argument cannot be read or understood.
    Refused : the record is readable but not usable (see ``timebase`` and ``audit``).
    """
    if isinstance(path, Record):
        return _as_it_is(path, columns=columns, units=units, scale=scale, rate=rate)
    named, stated = _pairs(columns, "columns"), _pairs(units, "units")
    factors = _factors(scale)
    rate = None if rate is None else _rate(rate, named)
    if not (isinstance(path, (str, os.PathLike)) or is_table(path)):
        raise InputError(f"record must be {FORMS}, not {shown(path)}.")
    table, file = _opened(path, named)
    choices, said = choose_columns(table, named, need_time=rate is None)
    choices, said = _without_time(table, choices, said) if rate else (choices, said)
    _check_used(table.source, choices, stated, factors)
    found = {c.role: _unit(table, c, stated, factors) for c in choices}
    drive = _motion(table.source, found, motion)
    raw, more = table.load([c.index for c in choices])
    if not len(raw[0]):
        raise InputError(f"{table.source} holds column names but no data.")
    raw, merging = merged([c.role for c in choices], raw)
    said = [*more, *said, *merging]
    channels = {}
    for choice, values in zip(choices, raw, strict=True):
        said += _remarks(table, choice, values, found, factors, drive)
        channels[choice.role] = _si(values, found[choice.role], factors.get(choice.role))
    labels = {role: unit.name if unit else None for role, unit in found.items()}
    if drive == "rotary":
        unstated = {role for role, unit in found.items() if unit is None and role not in factors}
        check_angles(table.source, channels, rate, unstated)
    return replace(_assembled(table, channels, labels, rate, drive, said), file=file)


def _opened(path: Any, named: Mapping[str, str]) -> tuple[Table, SourceFile | None]:
    """The table of a file, of standard input ("-") or in memory, and the file."""
    if is_table(path):
        return table_of(path, named), None
    if isinstance(path, (str, os.PathLike)) and os.fspath(path) == "-":
        table, data = read_stdin()
        return table, SourceFile.of_bytes("stdin", data)
    path = as_path(path, "record")
    return read_table(path), SourceFile.of(path)


def _rate(given: Any, named: Mapping[str, str]) -> float:
    """The sampling rate, Hz; InputError where it looks like the step in s."""
    rate = positive(given, "rate", "Hz")
    if rate < 0.5:
        raise InputError(
            f"--rate is in Hz; {rate:g} looks like the step in s: give --rate {1 / rate:.6g}."
        )
    if "t" in named:
        raise InputError("--rate and --columns t=NAME exclude each other: give one of them.")
    return rate


def _without_time(
    table: Table, choices: list[Choice], said: list[str]
) -> tuple[list[Choice], list[str]]:
    """The columns without that of t: the given rate takes its place."""
    time = next((table.names[c.index] for c in choices if c.role == "t"), None)
    if time is None:
        return choices, said
    note = f"The given rate was used in place of the column '{time}'."
    return [c for c in choices if c.role != "t"], [*said, note]


def _as_it_is(record: Record, **options: Any) -> Record:
    for what, value in options.items():
        if value is not None:
            raise InputError(f"{what} is for a log that is still to be read, not for a Record.")
    return record


def _si(values: np.ndarray, unit: Unit | None, factor: float | None) -> np.ndarray:
    return values * ((1.0 if factor is None else factor) * (unit.factor if unit else 1.0))


def _assembled(
    table: Table,
    channels: dict[str, np.ndarray],
    labels: dict[str, str | None],
    rate: float | None,
    motion: str,
    said: list[str],
) -> Record:
    """Bring SI channels to uniform time and check the record."""
    t = channels.pop("t", None)
    if t is None:
        t = np.arange(len(channels["u"])) / float(rate or 1.0)
    if motion == "rotary":  # before any interpolation, which would cut through the jumps
        for role in ("theta", "theta_load"):
            if role in channels:
                channels[role], more = unwrapped(role, channels[role], labels[role])
                said = [*said, *more]
    required = tuple(role for role in ("u", "w", "theta") if role in channels)
    record = uniform(Stamped(table.source, t, channels, table.where), required, motion)
    return audit(replace(record, messages=(*said, *record.messages)), labels)


# ---- what the user says -------------------------------------------------------------


def _known_roles(given: Mapping[str, object], what: str) -> None:
    for role in given:
        if role not in ROLES:
            raise InputError(
                f"--{what}: there is no role '{role}'{did_you_mean(role, ROLES)}; "
                f"roles are {', '.join(ROLES)}."
            )


def _pairs(given: Mapping[str, str] | str | None, what: str) -> dict[str, str]:
    if isinstance(given, str):
        return parse_pairs(given, what)
    _is_mapping(given, what)
    pairs = {str(role): str(value) for role, value in (given or {}).items()}
    _known_roles(pairs, what)
    return pairs


def _is_mapping(given: Any, what: str) -> None:
    if not (given is None or isinstance(given, (str, Mapping))):
        raise InputError(
            f"{what} must be a dict by role, such as {{'u': ...}}, or a text, u=..., "
            f"not {shown(given)}."
        )


def _factors(given: Mapping[str, float] | str | None) -> dict[str, float]:
    _is_mapping(given, "scale")
    pairs: dict[str, Any] = (
        parse_pairs(given, "scale")
        if isinstance(given, str)
        else {str(role): factor for role, factor in (given or {}).items()}
    )
    _known_roles(pairs, "scale")
    factors = {}
    for role, text in pairs.items():
        try:
            factors[role] = float(text)
        except (TypeError, ValueError):
            factors[role] = np.nan
        if not np.isfinite(factors[role]) or factors[role] == 0:
            raise InputError(f"--scale: '{text}' for {role} is not a number other than 0.")
    return factors


def _check_used(
    source: str,
    choices: list[Choice],
    stated: Mapping[str, object],
    factors: Mapping[str, object],
) -> None:
    present = {c.role for c in choices}
    for what, given in (("units", stated), ("scale", factors)):
        for role in given:
            if role not in present:
                raise InputError(f"--{what} names {role}, but {source} has no column for it.")


# ---- units --------------------------------------------------------------------------


def _unit(
    table: Table,
    choice: Choice,
    stated: Mapping[str, str],
    factors: Mapping[str, float],
) -> Unit | None:
    text = stated.get(choice.role) or table.units[choice.index] or choice.implied
    if text is None or (text == choice.implied and choice.role in factors):
        return None
    where = f"{table.source}, column '{table.names[choice.index]}'"
    return role_unit(choice.role, text, scaled=choice.role in factors, where=where)


def _motion(source: str, found: Mapping[str, Unit | None], given: str | None) -> str:
    """Return the kind of drive that the units belong to; units of both kinds are an error."""
    if not (given is None or (isinstance(given, str) and given in _FAST)):
        raise InputError(f"motion must be 'rotary' or 'linear', not {shown(given)}.")
    kinds = {role: unit for role, unit in found.items() if unit and unit.motion}
    for role, unit in kinds.items():
        for other, its in kinds.items():
            if its.motion != unit.motion:
                raise InputError(
                    f"{source}: {role} is in {unit.name} but {other} in {its.name}; "
                    "give all of them for a rotary drive or all for a linear one."
                )
        if given not in (None, unit.motion):
            raise InputError(
                f"{source}: {role} is in {unit.name}, which does not fit motion = '{given}'."
            )
    return given or next((str(unit.motion) for unit in kinds.values()), "rotary")


def _remarks(
    table: Table,
    choice: Choice,
    values: np.ndarray,
    found: Mapping[str, Unit | None],
    factors: Mapping[str, float],
    motion: str,
) -> list[str]:
    """Return notes on how the numbers of a channel were interpreted."""
    role, name, unit = choice.role, table.names[choice.index], found[choice.role]
    if role in factors:
        per = f" (in {unit.name})" if unit else ""
        return [f"{role} is {factors[role]:g} times column '{name}'{per}."]
    if unit is not None or role not in ("u", "w", "theta"):
        return []
    values = values[np.isfinite(values)]
    assumed = si_unit(role, motion)
    whole = bool(values.size) and np.ptp(values) >= 100 and not np.any(values % 1)
    if role == "theta" and whole:
        raise InputError(
            f"{table.source}, column '{name}': theta has no unit and holds whole numbers only, as "
            "encoder counts do: give --scale theta=FACTOR (SI value per count) or --units "
            "theta=UNIT."
        )
    if whole:
        return [
            f"{role} has no unit and holds whole numbers only: {assumed} was assumed; if these "
            f"are counts or another unit, give --scale {role}=FACTOR or --units {role}=UNIT."
        ]
    if role == "w" and "theta" not in found and np.abs(values).max(initial=0) > _FAST[motion]:
        return [
            f"w has no unit and reaches {np.abs(values).max():.4g}: {assumed} was assumed; "
            "if that is wrong, give --units w=UNIT."
        ]
    return []
