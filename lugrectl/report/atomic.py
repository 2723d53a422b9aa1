"""Files written together: all of them or none."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from ..core.errors import InputError
from ..core.unfinished import unfinished


def nearest(path: Path) -> Path:
    """The path itself, or the nearest parent that exists."""
    return next(p for p in (path, *path.parents) if os.path.lexists(p))


def write_all_or_say(content: Mapping[str, str], folder: Path, what: str) -> list[Path]:
    """As :func:`write_together`; the paths. InputError says that ``what`` cannot be written."""
    try:
        write_together(content, folder)
    except OSError as error:
        raise InputError(
            f"{folder}: the {what} cannot be written there ({error.strerror or error}); "
            "choose another folder."
        ) from None
    return [folder / name for name in content]


def write_together(content: Mapping[str, str], folder: Path) -> None:
    """Write texts by file name into a folder, which is created if it is missing.

    Everything is written to a hidden folder first, so that only renaming remains. On failure
    the previous state is restored and OSError is raised. A process that is killed leaves the
    folder as it was or with all files of one run; where the folder was there already, it may
    leave a part of them, but then without the first, and never files of two runs. What it left
    behind is removed by the next one.
    """
    folder = folder.absolute()
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
    made = [p for p in folder.parents if not p.exists()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        staged.rename(folder)
    except BaseException:
        for parent in made:
            if parent.exists():
                parent.rmdir()
        raise


def _exchange(staged: Path, folder: Path, names: list[str]) -> None:
    """Rename into an existing folder; on failure the previous files are restored.

    The first file goes first and comes last: where it is, the others are of the same run.
    """
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
