"""The files that names, patterns and folders stand for."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..core.validation import as_path, is_file, like_it
from .files.readers import SUFFIXES, read_table

_LOOSE = (".txt", ".dat", ".json")  # in a folder such files are logs only if they hold a table


def there(name: Any) -> None:
    """InputError where neither a file nor a folder has the name, and it is no pattern."""
    path = as_path(name, "records")
    if not (os.path.lexists(path) or glob.has_magic(str(path))):
        raise InputError(f"{path}: no such file or folder{like_it(Path(path))}.")


def files_of(name: str | Path, folders: bool = True) -> list[Path]:
    """The files that a name, a pattern or (with ``folders``) a folder stands for."""
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
    return path.suffix.lower() not in _LOOSE or _holds_table(path)


def _holds_table(path: Path) -> bool:
    try:
        read_table(path)
    except InputError:
        return False
    return True


def _natural(path: Path) -> list[Any]:
    """Sort key that compares numbers in names as numbers."""
    parts = re.split(r"(\d+)", str(path))
    return [int(p) if i % 2 else p for i, p in enumerate(parts)]
