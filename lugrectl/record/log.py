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
from .columns import roles
from .columns.raw_numbers import check_angles, signed
from .columns.table import FORMS, Table, is_table, row_number, table_of
from .columns.units import Unit, parse_unit, role_unit
from .files.readers import read_stdin, read_table
from .samples.resampling import held_mean

_FAST = {"rotary": 400.0, "linear": 20.0}  # rad/s, m/s: above, a w without unit may not be in SI
_TOGETHER = 0.5  # share of the rows with motion that hold u, too; below, they are two streams


class Kept:
    """What was computed from the rows of a log, with their checksum; it is not pickled."""

    def __init__(self) -> None:
        self.checksum: object = None
        self.value: Any = None

    def __reduce__(self) -> tuple[type[Kept], tuple[()]]:
        return Kept, ()


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
    kept: Kept = field(default_factory=Kept, repr=False, compare=False)

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
    named, stated = roles.texts(columns, "columns"), roles.texts(units, "units")
    scaled = roles.factors(scale)
    rate = None if rate is None else _rate(rate, named)
    table, file = _opened(path, named)
    choices, said = roles.choose_columns(table, named, need_time=rate is None)
    time = next((c for c in choices if c.role == "t"), None)
    if rate and time is not None:
        choices.remove(time)
        name = table.names[time.index]
        said = [*said, f"The given rate was used in place of the column '{name}'."]
    roles.check_used(table.source, [c.role for c in choices], units=stated, scale=scaled)
    reading = _Reading(table, tuple(choices), stated, scaled)
    reading.find_units(motion)
    raw, more = table.load([c.index for c in choices])
    if not len(raw[0]):
        raise InputError(f"{table.source} holds column names but no data.")
    raw, merging = _merged([c.role for c in choices], raw)
    taken = {r: unit for r in reading.unstated - {"t"} if (unit := si_unit(r, reading.motion))}
    said = [*more, *roles.usual_said(table, choices, named, taken), *said, *merging]
    channels, more = reading.channels(raw)
    said += [*reading.overridden(), *more]
    said += [] if "u" in named else roles.idle_said(table, choices, channels["u"])
    if reading.motion == "rotary":
        check_angles(table.source, channels, rate, reading.unstated)
    t = channels.pop("t", None)
    if t is None:
        t = np.arange(len(raw[0])) / float(rate or 1.0)
    labels = {role: unit.name if unit else None for role, unit in reading.units.items()}
    return Log(
        table.source, t, channels, table.where, labels, reading.motion, tuple(said), file=file
    )


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


# ---- rows of several streams, on one clock ------------------------------------------


def _merged(
    names: Sequence[str], columns: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], list[str]]:
    """Columns on the rows of the motion, where merged topics leave empty cells, and a sentence."""
    by = dict(zip(names, columns, strict=True))
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
    made = [by[r][rows] if r in ("t", base) else _at_rows(r, t, by[r], rows) for r in names]
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
    step = 1.5 * max(float(np.median(np.diff(t[at]))), dt)
    near = np.searchsorted(t[at], grid, side="right")
    since = grid - t[at][np.maximum(near - 1, 0)]
    made = np.where(near == 0, x[at][0], made)  # before its first message, the value of that
    return np.where((since < step) & (since > -step), made, np.nan)


# ---- units --------------------------------------------------------------------------


@dataclass
class _Reading:
    """The columns of a table that were chosen, and their units by role: stated by the user, in the
    header, or implied by a name. ``questions`` must be asked of them, all at once."""

    table: Table
    choices: tuple[roles.Choice, ...]
    stated: Mapping[str, str]
    scaled: Mapping[str, float]
    units: dict[str, Unit | None] = field(default_factory=dict)
    questions: dict[str, str] = field(default_factory=dict)
    motion: str = "rotary"

    @property
    def unstated(self) -> set[str]:
        """The roles whose unit nothing says."""
        found = self.units.items()
        return {role for role, unit in found if unit is None and role not in self.scaled}

    def find_units(self, motion: str | None) -> None:
        """Find the unit of each column, the user's first; None where nothing says one."""
        for role, index, implied in ((c.role, c.index, c.implied) for c in self.choices):
            header, scaled = self.table.units[index], role in self.scaled
            text = self.stated.get(role) or header or implied
            self.units[role] = None
            if text is None or (text == implied and scaled):
                continue
            where = f"{self.table.source}, column '{self.table.names[index]}'"
            named = role not in self.stated and not header
            try:
                self.units[role] = role_unit(role, text, scaled=scaled, where=where, named=named)
            except InputError as error:
                self.questions[role] = str(error)
        self.motion = _motion(self.table.source, self.units, motion)

    def overridden(self) -> list[str]:
        """A note on each unit that the user gave in place of another one in the header."""
        said = []
        for choice in self.choices:
            given, header = self.stated.get(choice.role), self.table.units[choice.index]
            here = parse_unit(header) if given and header else None
            if given and header and (here is None or here != parse_unit(given)):
                said.append(
                    f"The header says {choice.role} [{header}]; "
                    f"{option('units', f'{choice.role}={given}')} was used in its place."
                )
        return said

    def channels(self, raw: Sequence[np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
        """The columns in SI units by role, and notes on how their numbers were interpreted."""
        channels, said = {}, []
        for choice, column in zip(self.choices, raw, strict=True):
            values, more = signed(choice.role, column)
            said += more
            if choice.role not in self.questions:
                said += self._remarks(choice, values)
            unit = self.units[choice.role]
            factor = self.scaled.get(choice.role, 1.0) * (unit.factor if unit else 1.0)
            # a mark of a missing value may be as large as a float goes, or a NaN that signals
            with np.errstate(over="ignore", invalid="ignore"):
                channels[choice.role] = values * factor
        if self.questions:
            raise InputError(" ".join(self.questions.values()))
        return channels, said

    def _remarks(self, choice: roles.Choice, values: np.ndarray) -> list[str]:
        """Notes on the numbers of a channel, or the question that they raise."""
        role, name = choice.role, self.table.names[choice.index]
        unit, assumed = self.units[role], si_unit(role, self.motion)
        if role in self.scaled:
            per = f" (in {unit.name})" if unit else ""
            return [f"{role} is {self.scaled[role]:g} times column '{name}'{per}."]
        if unit is not None or role not in ("u", "w", "theta"):
            return []
        values = values[np.isfinite(values)]
        largest = np.abs(values).max(initial=0)
        whole = bool(values.size) and np.ptp(values) >= 100 and not np.any(values % 1)
        factor, other = option("scale", f"{role}=FACTOR"), option("units", f"{role}=UNIT")
        if role == "theta" and whole:
            self.questions[role] = (
                f"{self.table.source}, column '{name}': theta has no unit and holds whole numbers "
                f"only, as encoder counts do: give {factor} (SI value per count) or {other}."
            )
        elif whole:
            return [
                f"{role} has no unit and holds whole numbers only: {assumed} was assumed; if these "
                f"are counts or another unit, give {factor} or {other}."
            ]
        elif role == "w" and "theta" not in self.units and largest > _FAST[self.motion]:
            return [
                f"w has no unit and reaches {largest:.4g}: {assumed} was assumed; "
                f"if that is wrong, give {other}."
            ]
        return []


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
                f"{source}: {role} is in {unit.name}, which does not fit motion = '{given}'; for a "
                f'{unit.motion} drive the model needs motion = "{unit.motion}".'
            )
    return given or next((str(unit.motion) for unit in kinds.values()), "rotary")
