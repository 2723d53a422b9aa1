"""Records in any of the forms in which people have them: a path, a folder, a table, a Record."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.validation import as_path, is_file, like_it, shown
from .columns.table import FORMS, is_table
from .files.readers import SUFFIXES, read_table
from .log import Log
from .read import already_read, read_log, record_of
from .record import Record


def is_last(given: Any) -> bool:
    """Whether the last half is to be held out."""
    return isinstance(given, str) and given == "last"


def is_record(given: Any) -> bool:
    """Whether this is one record, in any form, rather than several."""
    return is_file(given) or isinstance(given, (Log, Record)) or is_table(given)


def as_record(
    given: Any, motion: str | None = None, what: str = "record", **reading: Any
) -> Record:
    """The record that is meant, read for a drive of that motion with these options of
    :func:`read_record`; InputError names the argument."""
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
    roles = [role for role in ("u", "w", "theta") if role in made.channels()]
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
    """The files that a name, a pattern or (with ``folders``) a folder stands for: axis2 before
    axis10; a pattern (``*``, ``?``, ``**``) stands for itself where a file has that very name."""
    path = Path(name)
    if folders and path.is_dir():
        files = [p for p in path.iterdir() if _is_record(p)]
        if not files:
            raise InputError(f"{path} holds no record ({', '.join(SUFFIXES)}).")
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
    if path.suffix.lower() not in SUFFIXES or hidden or not path.is_file():
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
