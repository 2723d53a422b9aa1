"""Files written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from .errors import InputError


@contextlib.contextmanager
def whole(path: Path, mode: int = 0o666) -> Iterator[Path]:
    """A hidden file that becomes ``path`` at the end: others see all of it or nothing."""
    part = unfinished(path.parent)
    part.touch(mode)
    try:
        yield part
        os.replace(part, path)
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def write_whole(path: Path, content: bytes, option: str = "") -> None:
    """Write a file whole or not at all; InputError leaves what was there."""
    try:
        if path.exists() and not path.is_file():  # a device or a pipe
            path.write_bytes(content)
            return
        with whole(path.resolve()) as part:  # what a link points at
            part.write_bytes(content)
    except OSError as error:
        name = f"{option} {path}".strip()
        raise InputError(f"{name} cannot be written: {error.strerror or error}.") from None


def write_together(content: Mapping[str, str], folder: Path, complaint: str) -> list[Path]:
    """Write texts by file name into a folder, all or none; InputError's ``complaint`` takes why."""
    created = [p for p in (folder.absolute(), *folder.absolute().parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        staged = unfinished(folder)
        staged.mkdir()
        try:
            for name, body in content.items():
                (staged / name).write_text(body, encoding="utf-8", errors="replace")
            _exchange(staged, folder, list(content))
        finally:
            shutil.rmtree(staged, ignore_errors=True)
    except BaseException as error:
        for parent in created:
            with contextlib.suppress(OSError):
                parent.rmdir()
        if not isinstance(error, OSError):
            raise
        raise InputError(f"{folder}: {complaint.format(error.strerror or error)}") from None
    return [folder / name for name in content]


def nearest(path: Path) -> Path:
    """The path itself, or the nearest parent that exists."""
    return next(p for p in (path, *path.parents) if os.path.lexists(p))


def _exchange(staged: Path, folder: Path, names: list[str]) -> None:
    """Rename into an existing folder; on failure the previous files are restored. The first file
    goes first and comes last: where it is, the others are of the same run."""
    try:
        for name in names:
            if (folder / name).exists():
                os.replace(folder / name, staged / f"old-{name}")
        for name in reversed(names):
            os.replace(staged / name, folder / name)
    except BaseException:
        for name in names:
            if (staged / f"old-{name}").exists():
                os.replace(staged / f"old-{name}", folder / name)
            elif not (staged / name).exists():
                (folder / name).unlink(missing_ok=True)
        raise


def unfinished(folder: Path) -> Path:
    """Return a new hidden name in a folder."""
    return folder / f".lugrectl-{os.urandom(8).hex()}"
