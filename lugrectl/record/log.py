"""A log as it was recorded: its rows in SI units, with nothing filled in, merged or resampled."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from zlib import crc32

import numpy as np

from ..core.errors import InputError
from ..core.option_names import option
from ..core.provenance import SourceFile
from ..core.unit_names import si_unit
from ..core.validation import as_path, positive, shown
from .columns.names import (
    UNITS,
    Choice,
    Unit,
    by_role,
    choose_columns,
    factors,
    role_unit,
    usual_said,
)
from .columns.raw_numbers import check_angles, signed
from .columns.table import FORMS, Table, is_table, row_number, table_of
from .files.readers import read_stdin, read_table
from .samples.rows import held_mean

_FAST = {"rotary": 400.0, "linear": 20.0}  # rad/s, m/s: above, a w without unit may not be in SI
_TOGETHER = 0.5  # share of the rows with motion that hold u, too; below, they are two streams
Units = Mapping[str, Unit | None]  # by role; None where nothing says one


@dataclass(frozen=True, eq=False)
class Log:
    """A log as it was recorded: every row of the file."""

    source: str
    t: np.ndarray  # (N,) s
    channels: dict[str, np.ndarray]  # by role, (N,) in SI units; NaN where there is no number
    where: Callable[[int], str]  # "line 2102" of a text, its header counted; "row 2100" elsewhere
    labels: dict[str, str | None]  # units by role as stated, None where none was
    motion: str  # "rotary" or "linear"
    messages: tuple[str, ...] = ()  # how the columns were interpreted
    cuts: tuple[int, ...] = ()  # rows known to begin a new part
    of: int = 0  # checksum of the record that was made from these rows, 0 if there is none
    file: SourceFile | None = None
    kept: dict[Any, Any] = field(default_factory=dict, repr=False)  # found in the rows, by checksum

    def __getstate__(self) -> dict[str, Any]:
        """Without what was found in the rows: a pickle holds them once."""
        return {**vars(self), "kept": {}}

    def checksum(self) -> tuple[object, ...]:
        """What changes with the rows, their units or their parts."""
        rows = {"t": self.t, **self.channels}
        sums = tuple((role, crc32(np.ascontiguousarray(x).data)) for role, x in rows.items())
        stated = tuple(sorted(self.labels.items()))
        return self.source, self.motion, stated, self.cuts, id(self.where), sums


def log_of_arrays(
    source: str, channels: Mapping[str, np.ndarray], motion: str, cuts: tuple[int, ...] = ()
) -> Log:
    """Channels in SI units by role, t among them in s, as a log; rows are counted from 0."""
    others = {role: values for role, values in channels.items() if role != "t"}
    labels: dict[str, str | None] = {**dict.fromkeys(channels), "t": "s"}
    return Log(source, channels["t"], others, row_number, labels, motion, cuts=cuts)


def rows_of(
    path: Any,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    motion: str | None = None,
) -> Log:
    """The rows of a log in units stated or assumed; arguments as of :func:`read_record`."""
    named, stated = by_role(columns, "columns"), by_role(units, "units")
    scaled = factors(scale)
    rate = None if rate is None else _rate(rate, named)
    table, file = _opened(path, named)
    choices, said = choose_columns(table, named, need_time=rate is None)
    if rate and choices[0].role == "t":
        time = table.names[choices.pop(0).index]
        said = [*said, f"The given rate was used in place of the column '{time}'."]
    found, asked = _units(table, choices, stated, scaled)
    motion = _motion(table.source, found, motion)
    raw, more = _loaded(table, choices)
    more += _since_1970(table.names[choices[0].index], raw[0], {} if "t" in scaled else found)
    raw, merging = _merged([c.role for c in choices], raw)
    unstated = {role for role, unit in found.items() if unit is None and role not in scaled}
    taken = {role: unit for role in unstated - {"t"} if (unit := si_unit(role, motion))}
    said = [*more, *usual_said(table, choices, named, taken), *said, *merging]
    channels = {}
    for choice, column in zip(choices, raw, strict=True):
        role, unit = choice.role, found[choice.role]
        values, more = signed(role, column)
        said += more
        if unit is None and role not in scaled and role not in asked:
            question, note = _doubt(role, values, motion, found)
            said += note
            where = f"{table.source}, column '{table.names[choice.index]}'"
            asked |= {role: f"{where}: {question}"} if question else {}
        factor = scaled.get(role, 1.0) * (unit.factor if unit else 1.0)
        # a mark of a missing value may be as large as a float goes, or a NaN that signals
        with np.errstate(over="ignore", invalid="ignore"):
            channels[role] = values * factor
    if asked:
        raise InputError(" ".join(asked.values()))
    t = channels.pop("t", None)
    if t is None:
        t = np.arange(len(raw[0])) / float(rate or 1.0)
    if motion == "rotary" and "theta" in unstated:
        speed = "w" in unstated if "w" in channels else None
        check_angles(table.source, channels["theta"], t, speed)
    labels = {role: unit.name if unit else None for role, unit in found.items()}
    return Log(table.source, t, channels, table.where, labels, motion, tuple(said), file=file)


def _opened(path: Any, named: Mapping[str, str]) -> tuple[Table, SourceFile | None]:
    """The table of a file, of standard input ("-") or in memory, and the file."""
    if is_table(path):
        return table_of(path, named), None
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"record must be {FORMS}, not {shown(path)}.")
    if os.fspath(path) == "-":
        table, data = read_stdin()
        return table, SourceFile.of_bytes("stdin", data)
    path = as_path(path, "record")
    return read_table(path), SourceFile.of(path)


def _rate(given: Any, named: Mapping[str, str]) -> float:
    """The sampling rate, Hz; InputError where it looks like the step in s."""
    rate = positive(given, "rate", "Hz")
    if rate < 0.5:
        raise InputError(
            f"{option('rate')} is in Hz; {rate:g} looks like the step in s: give "
            f"{option('rate', f'{1 / rate:.6g}')}."
        )
    if "t" in named:
        both = f"{option('rate')} and {option('columns', 't=NAME')}"
        raise InputError(f"{both} exclude each other: give one of them.")
    return rate


def _loaded(table: Table, choices: Sequence[Choice]) -> tuple[list[np.ndarray], list[str]]:
    """The columns, with notes; those of a time in two columns, seconds and nanoseconds, as one."""
    rest = [table.nanoseconds(c.index) if c.role == "t" else None for c in choices]
    raw, said = table.load([c.index for c in choices] + [i for i in rest if i is not None])
    if not len(raw[0]):
        raise InputError(f"{table.source} holds column names but no data.")
    if len(raw) > len(choices):
        at, fine = [i is not None for i in rest].index(True), raw.pop()
        whole = raw[at][np.isfinite(raw[at])]
        raw[at] = raw[at] - (whole[0] if whole.size else 0.0) + 1e-9 * fine
    return raw, said


def _since_1970(name: str, t: np.ndarray, found: dict[str, Unit | None]) -> list[str]:
    """Add the unit of times since 1970, in the years from 2001 to 2096; returns a note on it."""
    known = t[np.isfinite(t)]
    for unit in ("s", "ms", "us", "ns") if found.get("t", t) is None and known.size else ():
        one = 1e9 / UNITS[unit].factor
        if one <= known[0] <= known[-1] < 4 * one:
            found["t"] = UNITS[unit]
            return [f"'{name}' holds {unit} since 1970 (its unit is not stated)."] * (unit != "s")
    return []


# ---- rows of several streams, on one clock ------------------------------------------


def _merged(
    roles: Sequence[str], columns: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], list[str]]:
    """Columns on the rows of the motion, where merged topics leave empty cells, and a sentence."""
    by = dict(zip(roles, columns, strict=True))
    base = next((role for role in ("theta", "w") if role in by), None)
    if base is None or "t" not in by or "u" not in by:
        return list(columns), []
    t = by["t"]
    stamped = np.isfinite(t)
    rows = np.flatnonzero(np.isfinite(by[base]) & stamped)
    if len(rows) < 2 or np.isfinite(by["u"][rows]).mean() >= _TOGETHER:
        return list(columns), []
    if np.sum(np.isfinite(by["u"]) & stamped) < 2 or np.any(np.diff(t[stamped]) < 0):
        return list(columns), []
    made = [by[r][rows] if r in ("t", base) else _at_rows(r, t, by[r], rows) for r in roles]
    said = (
        f"u and {base} stand in different rows: the {len(rows)} rows of {base} were used, with "
        "the torque held between its own rows."
    )
    return made, [said]


def _at_rows(role: str, t: np.ndarray, x: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """A channel at the times of other rows; nan where its own rows are far away."""
    at = np.flatnonzero(np.isfinite(x) & np.isfinite(t))
    if len(at) < 2:
        return np.full(len(rows), np.nan)
    grid = t[rows]
    dt = float(np.median(np.diff(grid)))
    made = held_mean(t[at], x[at], grid, dt) if role == "u" else np.interp(grid, t[at], x[at])
    before = np.searchsorted(t[at], grid, side="right") - 1
    made, before = np.where(before < 0, x[at][0], made), before.clip(0)
    step = 1.5 * max(float(np.median(np.diff(t[at]))), dt)
    return np.where(np.abs(grid - t[at][before]) < step, made, np.nan)


# ---- units --------------------------------------------------------------------------


def _units(
    table: Table,
    choices: Sequence[Choice],
    stated: Mapping[str, str],
    scaled: Mapping[str, float],
) -> tuple[dict[str, Unit | None], dict[str, str]]:
    """The unit of each column, the user's before the header's before the name's; and what must be
    asked of them, all at once."""
    known = [c.role for c in choices]
    for what, given in (("units", stated), ("scale", scaled)):
        for role in (r for r in given if r not in known):
            none = f"names {role}, but {table.source} has no column for it"
            raise InputError(f"{option(what)} {none}.")
    found: dict[str, Unit | None] = {}
    asked: dict[str, str] = {}
    for role, index, implied in ((c.role, c.index, c.implied) for c in choices):
        written = stated.get(role) or table.units[index]
        text = written or (None if role in scaled else implied)
        where, found[role] = f"{table.source}, column '{table.names[index]}'", None
        try:
            if text is not None:
                found[role] = role_unit(
                    role, text, scaled=role in scaled, where=where, named=not written
                )
        except InputError as error:
            asked[role] = str(error)
    return found, asked


def _motion(source: str, found: Units, given: str | None) -> str:
    """Return the kind of drive that the units belong to; units of both kinds are an error."""
    if not (given is None or (isinstance(given, str) and given in _FAST)):
        raise InputError(f"motion must be 'rotary' or 'linear', not {shown(given)}.")
    kinds = {role: unit for role, unit in found.items() if unit and unit.motion}
    motions = {str(unit.motion) for unit in kinds.values()}
    if len(motions | ({given} if given else set())) > 1:
        listed = ", ".join(f"{role} is in {unit.name}" for role, unit in kinds.items())
        how = f"motion is '{given}'" if len(motions) == 1 else "these are of two kinds of drive"
        raise InputError(
            f"{source}: {listed}, but {how}; give all of them for a rotary drive or all for a "
            'linear one, whose model has motion = "linear".'
        )
    return given or next(iter(motions), "rotary")


def _doubt(role: str, values: np.ndarray, motion: str, found: Units) -> tuple[str, list[str]]:
    """What must be asked of a column without a unit by its numbers, or a note on it."""
    values = values[np.isfinite(values)]
    largest = np.abs(values).max(initial=0)
    why = f"reaches {largest:.4g}"
    if values.size and np.ptp(values) >= 100 and not np.any(values % 1):
        why = "holds whole numbers only, as counts do"
    elif role != "w" or "theta" in found or largest <= _FAST[motion]:
        return "", []
    cure = f"give {option('scale', f'{role}=FACTOR')} or {option('units', f'{role}=UNIT')}"
    if role == "theta":
        return f"theta has no unit and {why}: {cure}.", []
    si = si_unit(role, motion)
    said = f"{role} has no unit and {why}: {si} was assumed; if that is wrong, {cure}."
    return "", [said] if role in ("u", "w") else []
