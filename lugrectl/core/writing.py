"""Files written whole or not at all; what a killed process leaves is removed by the next one."""

from __future__ import annotations

import contextlib
import os
import platform
import re
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from .errors import InputError

_OLD = 86_400.0  # s after which what another machine left behind is removed
_PREFIX = ".lugrectl-"


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
    try:
        _together(content, folder.absolute())
    except OSError as error:
        raise InputError(f"{folder}: {complaint.format(error.strerror or error)}") from None
    return [folder / name for name in content]


def nearest(path: Path) -> Path:
    """The path itself, or the nearest parent that exists."""
    return next(p for p in (path, *path.parents) if os.path.lexists(p))


def _together(content: Mapping[str, str], folder: Path) -> None:
    base = nearest(folder)
    staged = unfinished(base)
    staged.mkdir()
    try:
        for name, body in content.items():
            (staged / name).write_text(body, encoding="utf-8", errors="replace")
        if base == folder:
            _exchange(staged, folder, list(content))
        else:
            _settle(staged, folder)
    finally:
        shutil.rmtree(staged, ignore_errors=True)


def _settle(staged: Path, folder: Path) -> None:
    """Rename to a folder that does not exist; on failure parents created for it are removed."""
    created = [p for p in folder.parents if not p.exists()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        staged.rename(folder)
    except BaseException:
        for parent in created:
            if parent.exists():
                parent.rmdir()
        raise


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
    """Return a new hidden name in a folder; what processes that ended left there is removed."""
    mine = _names_of(os.getpid())
    for left in folder.glob(f"{_PREFIX}*"):
        known = re.fullmatch(r"\.lugrectl-\w+-(\d+)-[0-9a-f]{12}", left.name)
        with contextlib.suppress(OSError):  # another process may have removed it
            pid = int(known[1]) if known else 0
            old = time.time() - left.stat().st_mtime > _OLD
            if known and (old or (left.name.startswith(_names_of(pid)) and not _runs(pid))):
                shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink()
    return folder / f"{mine}{secrets.token_hex(6)}"


def _names_of(pid: int) -> str:
    """What the hidden names of a process of this machine begin with."""
    host = "".join(c for c in platform.node() if c.isalnum()) or "host"
    return f"{_PREFIX}{host}-{pid}-"


def _runs(pid: int) -> bool:
    """Whether a process of this machine runs; where that cannot be asked, it may."""
    with contextlib.suppress(OSError, OverflowError):
        if os.name == "posix":
            try:
                os.kill(pid, 0)
            except ProcessLookupError:
                return False
    return True
