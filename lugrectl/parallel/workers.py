"""Helpers for a fleet's jobs: the files, models sent to other processes, threads."""

from __future__ import annotations

import contextlib
import glob
import importlib
import os
import pickle
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..blocks.as_model import is_file, is_record
from ..blocks.block import REGISTRY, members
from ..blocks.model import Model
from ..core.errors import InputError
from ..core.validation import as_path, like_it, shown
from ..record.files.readers import SUFFIXES, read_table
from .blas_threads import BLAS

_LOOSE = (".txt", ".dat", ".json")  # in a folder such files are logs only if they hold a table
_THREADS = ("OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS", *BLAS)


def record_files(logs: Iterable[Any]) -> list[Any]:
    """The logs with folders and patterns replaced by the files they stand for, each file once.

    A folder stands for its files of SUFFIXES, axis2 before axis10; a pattern
    (``*``, ``?``, ``**``) for what it matches, unless a file has that very name.

    Raises InputError for a folder without such files and for a pattern without match.
    """
    found: dict[Any, Any] = {}
    for log in logs:
        if not is_record(log):
            raise InputError(f"each log must be a path, a table or a Record, not {shown(log)}.")
        for one in files_of(log) if is_file(log) else [log]:
            found.setdefault(os.path.abspath(one) if is_file(one) else id(one), one)
    if not found:
        raise InputError("there is no record to diagnose.")
    return list(found.values())


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


@contextlib.contextmanager
def one_thread_each(on: bool = True) -> Iterator[None]:
    """Processes started inside use one numerical thread, unless the user set another number."""
    added = [name for name in _THREADS if on and name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)


@dataclass(frozen=True)
class Sent:
    """A model for another process, with the names of the user's own effects to load there."""

    packed: bytes
    effects: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, model: Model) -> Sent:
        own = [(b.name, b.home) for b in members("effect").values()]
        return cls(pickle.dumps(model), tuple(e for e in own if not _ours(e[1])))

    def open(self) -> Model:
        """The model; raises InputError if one of the user's blocks is not known here."""
        for name, home in self.effects:
            _known("effect", name, home)
        return pickle.loads(self.packed)


def _ours(home: str) -> bool:
    return home.split(".")[0] == "lugrectl"


def _known(kind: str, name: str, home: str) -> None:
    """Import the module of a registered block if necessary; InputError if it stays unknown."""
    if (kind, name) not in REGISTRY:
        with contextlib.suppress(ImportError):
            importlib.import_module(home)
    if (kind, name) not in REGISTRY:
        raise InputError(
            f"the {kind} '{name}' is not known in the worker processes; define it in a module "
            "that can be imported, or use jobs=1."
        )
