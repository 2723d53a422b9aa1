"""Where a result comes from: version, date, command, and the files that were read."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, is_dataclass, replace
from datetime import datetime
from functools import wraps
from importlib import metadata
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
_FILES = ("record", "model", "holdout")  # arguments that are files or were read from one


@dataclass(frozen=True)
class SourceFile:
    """A file that was read: its name, the SHA-256 of its bytes, its path as it was given."""

    name: str
    sha256: str
    path: str = field(default="", compare=False)

    @classmethod
    def of(cls, path: str | Path) -> SourceFile | None:
        """The file at a path, read in pieces; None where no plain file is there."""
        path = Path(path)
        try:
            if not path.is_file():
                return None
            with path.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
        except (OSError, ValueError):
            return None
        return cls(path.name, digest, str(path))

    @classmethod
    def of_bytes(cls, name: str, data: bytes) -> SourceFile:
        """What came from no file (standard input), under a name."""
        return cls(name, hashlib.sha256(data).hexdigest(), name)


@dataclass(frozen=True)
class Provenance:
    """What a result was computed by and from; ``date`` is ISO 8601, ``command`` as it was typed."""

    version: str
    date: str
    command: str
    files: tuple[SourceFile, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "provenance" in the JSON document."""
        return {
            "version": self.version,
            "date": self.date,
            "command": self.command,
            "files": [{"name": f.name, "sha256": f.sha256} for f in self.files],
        }


def version() -> str:
    """The installed version; "unknown" in a source tree that is not installed."""
    try:
        return metadata.version("lugrectl")
    except metadata.PackageNotFoundError:
        return "unknown"


def now() -> datetime:
    """The time with its zone; a function of its own, so that a test can set it."""
    return datetime.now().astimezone()


def provenance(command: str, inputs: Iterable[Any] = ()) -> Provenance:
    """The provenance of a result of this moment; inputs that name no file are left out."""
    files = tuple(dict.fromkeys(_files(inputs)))
    return Provenance(version(), now().isoformat(timespec="seconds"), command, files)


def stamp(result: R, command: str, inputs: Iterable[Any] = ()) -> R:
    """A result with its provenance; the files that it already names stay."""
    if not is_dataclass(result) or isinstance(result, type) or not hasattr(result, "provenance"):
        return result
    before = getattr(result, "provenance", None)
    made = provenance(command, () if before else inputs)
    made = replace(made, files=before.files) if before else made
    return replace(result, provenance=made)


def stamped(command: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Have a function of (record, model, *, holdout) stamp what it returns."""

    def around(work: Callable[P, R]) -> Callable[P, R]:
        @wraps(work)
        def stamping(*given: P.args, **options: P.kwargs) -> R:
            result = work(*given, **options)
            return stamp(result, command, [*given[:2], *(options.get(k) for k in _FILES)])

        return stamping

    return around


def _files(inputs: Iterable[Any]) -> Iterator[SourceFile]:
    for one in inputs:
        if isinstance(one, SourceFile):
            yield one
        elif isinstance(one, (list, tuple)):
            yield from _files(one)
        elif isinstance(one, (str, Path)):
            found = None if one == "last" else SourceFile.of(one)
            if found is not None:
                yield found
        elif isinstance(file := getattr(one, "file", None), SourceFile):
            yield file
