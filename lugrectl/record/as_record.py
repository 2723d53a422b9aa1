"""From a log to its Record: bad samples left out, uniform time, channels that agree; and records in
any of the forms in which people have them: a path, a folder, a table, a Record."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import InputError, Refused
from ..core.validation import as_path, is_file, like_it, shown
from .columns.table import FORMS, is_table
from .consistency import audit, fitting_speed, unit_mistake
from .files.readers import read_table, suffixes
from .log import Log, rows_of
from .record import Record
from .samples.rows import REQUIRED
from .uniform_time import uniform, usable


def read_record(
    path: Any,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    motion: str | None = None,
) -> Record:
    """Read a measured log: text, JSON, MAT, NPY, NPZ; with ``files`` HDF5, Parquet, Excel.

    Bad samples are found first and left out; the record's messages name them. ``record.log``
    keeps the rows as they were recorded. Files of other formats are read by the package that
    offers for their ending, say mf4, the entry point ``mf4 = "package:function"`` in the group
    ``lugrectl.readers``: its function makes a dict of columns or a DataFrame of a path.

    Parameters
    ----------
    path : path, "-", Log, dict of arrays, DataFrame or Record
        A file, "-" for standard input, or the columns themselves: a dict of arrays or a pandas
        DataFrame, whose names may carry units as in a file, ``w [rpm]``. If no column is t, the
        index of a DataFrame is taken for it where it holds times or is named t or time. A Record is
        returned unchanged.
    columns : dict or str, optional
        Role -> name of the column, or its number from 1, for columns not named by their role;
        ``rec.x[2]`` is the second column of the matrix x in the struct rec.
    units : dict or str, optional
        Role -> unit, in place of the unit in the header; without any unit, SI is assumed.
    scale : dict or str, optional
        Role -> factor on the raw value, before the unit; needed for A, V, % and counts. It and the
        two above may be a text such as "t=time,u=torque".
    rate : float, optional
        Sampling rate in Hz, needed when there is no t; a column of t is then not used.
    motion : "rotary" or "linear", optional
        Taken from the units when not given.

    Returns
    -------
    Record
        In SI units on uniform time.

    Raises
    ------
    InputError
        When the file or an argument cannot be read or understood.
    Refused
        When there is no motion in it: a dead channel, or fewer than 12 rows in one piece.

    Examples
    --------
    A log as a drive's scope writes it: motor current and speed in rpm, at 1 kHz. The torque
    constant of the motor is 0.12 N m/A.

    >>> t = 1e-3 * np.arange(500)
    >>> log = {"Iq": 3.0 * np.sin(12.0 * t), "speed": 60.0 * np.sin(12.0 * t - 0.1)}
    >>> record = lg.read_record(
    ...     log, columns="u=Iq,w=speed", units="u=A,w=rpm", scale="u=0.12", rate=1000.0
    ... )
    >>> record.samples, round(float(record.w.max()), 2), round(float(record.u.max()), 2)
    (500, 6.28, 0.36)
    """
    if isinstance(path, Record):
        return already_read(path, columns=columns, units=units, scale=scale, rate=rate)
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate, "motion": motion}
    return record_of(path if isinstance(path, Log) else read_log(path, **reading))


def read_log(path: Any, **reading: Any) -> Log:
    """The rows of a log, read as by :func:`read_record`; a mixed-up unit of w, theta corrected."""
    return _in_true_units(rows_of(path, **reading))


def _in_true_units(log: Log) -> Log:
    if not {"w", "theta"} <= set(log.channels):
        return log
    try:
        found = unit_mistake(uniform(usable(log)), log.labels)
    except Refused:  # too short to compare them
        return log
    if found is None:
        return log
    role, unit, factor, said = found
    return replace(
        log,
        channels={**log.channels, role: log.channels[role] * factor},
        labels={**log.labels, role: unit},
        messages=(*log.messages, said),
        kept={},
    )


def record_of(log: Log | Record, *, alone: bool = True) -> Record:
    """A log on uniform time, without bad samples; ``alone``: it is the drive's only run."""
    if isinstance(log, Record):
        return log
    made = audit(_uniform(log), alone=alone)
    return replace(made, file=log.file).read_from(log)


def already_read(record: Record, **options: Any) -> Record:
    """A Record as it is; InputError where an option says how to read it."""
    for what, value in options.items():
        if value is not None:
            raise InputError(f"{what} is for a log that is still to be read, not for a Record.")
    return record


def _uniform(log: Log) -> Record:
    record = uniform(usable(log))
    return replace(record, messages=(*log.messages, *record.messages))


def consistent(record: Record) -> Record:
    """The record on uniform time, with a w that fits d theta/dt; Refused if too little is left."""
    log = record.log
    assert log is not None  # a record always has one
    made = record
    if log.channels["u"] is record.u:  # it was never read
        log = _in_true_units(log)
        found = _uniform(log)
        if found.messages:
            messages = (*record.messages, *found.messages)
            dropped = record.dropped + found.dropped
            made = replace(found, messages=messages, dropped=dropped, file=record.file)
    made = fitting_speed(made)
    return made if made.log is log else made.read_from(log)


# ---- in any form ----------------------------------------------------------------


def is_last(given: Any) -> bool:
    """Whether the last half is to be held out."""
    return isinstance(given, str) and given == "last"


def is_record(given: Any) -> bool:
    """Whether this is one record, in any form, rather than several."""
    return is_file(given) or isinstance(given, (Log, Record)) or is_table(given)


def as_record(
    given: Any, motion: str | None = None, what: str = "record", **reading: Any
) -> Record:
    """The record that is meant, read with options of :func:`read_record`; errors name ``what``."""
    return record_of(as_log(given, motion, what, **reading))


def as_log(
    given: Any, motion: str | None = None, what: str = "record", **reading: Any
) -> Log | Record:
    """The log that is meant, its rows as recorded; a Record is returned as it is."""
    if isinstance(given, (Log, Record)):
        return given
    if is_record(given):
        return read_log(given, **reading, motion=motion)
    if isinstance(given, np.ndarray):
        raise InputError(
            f"{what} is an array without names of its columns: give them as a dict of arrays, such "
            'as {"t": x[:, 0], "u": x[:, 1], "theta": x[:, 2]}.'
        )
    raise InputError(f"{what} must be {FORMS}, not {shown(given)}.")


def as_logs(given: Any, motion: str | None = None, **reading: Any) -> tuple[Log | Record, ...]:
    """The logs that are meant; options of :func:`read_record` are for those still to be read."""
    if is_file(given) and os.path.isdir(given):  # a folder stands for the logs in it
        given = files_of(given)
    if is_record(given) or isinstance(given, np.ndarray) or not isinstance(given, Iterable):
        if isinstance(given, Record):
            already_read(given, **reading)
        return (as_log(given, motion, **reading),)
    found = tuple(as_log(one, motion, "each record", **reading) for one in given)
    if not found:
        raise InputError("record is an empty list: give at least one record.")
    return found


def as_holdout(
    given: Any, records: Record | Sequence[Record], motion: str | None = None, **reading: Any
) -> str | Record | None:
    """None, "last" or a record of its own, read like the others."""
    if given is None or is_last(given):
        return given
    if not is_record(given):
        raise InputError(f"holdout must be None, 'last', {FORMS}, not {shown(given)}.")
    made = as_record(given, motion, "holdout", **reading)
    roles = [role for role in REQUIRED if role in made.channels()]
    for record in records if isinstance(records, Sequence) else [records]:
        ours, theirs = made.channels(), record.channels()
        if all(k in theirs and np.array_equal(ours[k], theirs[k]) for k in roles):
            raise InputError(
                "holdout holds the same samples as a record to fit to: give a run of its own or "
                "'last'."
            )
    return made


def record_files(logs: Iterable[Any]) -> list[Any]:
    """The logs with folders and patterns replaced by the files they stand for, each file once."""
    found: dict[Any, Any] = {}
    for log in logs:
        if not is_record(log):
            raise InputError(f"each log must be a path, a table or a Record, not {shown(log)}.")
        for one in files_of(log) if is_file(log) else [log]:
            found.setdefault(os.path.abspath(one) if is_file(one) else id(one), one)
    if not found:
        raise InputError("there is no record to diagnose.")
    return list(found.values())


# ---- files that names, patterns and folders stand for ----------------------------

_LOOSE = (".txt", ".dat", ".json")  # in a folder such files are logs only if they hold a table


def there(name: Any) -> None:
    """InputError where neither a file nor a folder has the name, and it is no pattern."""
    path = as_path(name, "records")
    if not (os.path.lexists(path) or glob.has_magic(str(path))):
        raise InputError(f"{path}: no such file or folder{like_it(Path(path))}.")


def files_of(name: str | Path, folders: bool = True) -> list[Path]:
    """The files of a name, a pattern (itself where a file has that name) or a folder, in order."""
    path = Path(name)
    if folders and path.is_dir():
        files = [p for p in path.iterdir() if _is_record(p)]
        if not files:
            raise InputError(f"{path} holds no record ({', '.join(suffixes())}).")
        return sorted(files, key=_natural)
    if os.path.lexists(path) or not glob.has_magic(str(path)):
        return [path]
    matches = sorted(map(Path, glob.glob(str(path), recursive=True)), key=_natural)
    if not matches:
        raise InputError(f"{path} matches no file.")
    return [file for match in matches for file in files_of(match, folders)]


def passed_over(logs: Iterable[Any]) -> list[Path]:
    """The files in the named folders that no log is read from, without hidden ones."""
    folders = [Path(log) for log in logs if is_file(log) and Path(log).is_dir()]
    files = [p for folder in folders for p in folder.iterdir() if p.is_file()]
    left = [p for p in files if not (p.name.startswith(".") or _is_record(p))]
    return sorted(left, key=_natural)


def _is_record(path: Path) -> bool:
    hidden = path.name.startswith(".")
    if path.suffix.lower() not in suffixes() or hidden or not path.is_file():
        return False
    if path.suffix.lower() in _LOOSE:
        try:
            read_table(path)
        except InputError:
            return False
    return True


def _natural(path: Path) -> list[Any]:
    """Sort key that compares numbers in names as numbers."""
    parts = re.split(r"(\d+)", str(path))
    return [int(p) if i % 2 else p for i, p in enumerate(parts)]
