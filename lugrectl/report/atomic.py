"""Files written together: all of them or none."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path


def nearest(path: Path) -> Path:
    """The path itself, or the nearest parent that exists."""
    return next(p for p in (path, *path.parents) if os.path.lexists(p))


def write_together(content: Mapping[str, str], folder: Path) -> None:
    """Write texts by file name into a folder, which is created if it is missing.

    Everything is written to a hidden folder first, so that only renaming remains. On failure
    the previous state is restored and OSError is raised.
    """
    folder = folder.absolute()
    base = nearest(folder)
    staged = base / f".lugrectl-{secrets.token_hex(6)}"
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
    """Rename into an existing folder; on failure the previous files are restored."""
    done: list[str] = []
    try:
        for name in names:
            done.append(name)
            if (folder / name).exists():
                os.replace(folder / name, staged / f"old-{name}")
            os.replace(staged / name, folder / name)
    except BaseException:
        for name in done:
            if (staged / f"old-{name}").exists():
                os.replace(staged / f"old-{name}", folder / name)
            elif not (staged / name).exists():
                (folder / name).unlink(missing_ok=True)
        raise
