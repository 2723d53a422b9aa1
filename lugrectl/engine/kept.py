"""The directory where generated code stays for the next process."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from functools import cache
from pathlib import Path


def cache_dir() -> Path:
    """Where generated code is kept: $LUGRECTL_CACHE, else the user's cache directory.

    A temporary directory of this process where neither can be written.
    """
    return _usable(os.environ.get("LUGRECTL_CACHE") or str(_user_cache()))


def _user_cache() -> Path:
    if os.name == "nt":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "lugrectl"


@cache
def _usable(wanted: str) -> Path:
    try:
        path = Path(wanted)
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return path
    except OSError:
        return Path(tempfile.mkdtemp(prefix="lugrectl-"))


def write_whole(path: Path, text: str) -> None:
    """Another process sees the whole file or none."""
    make_room(path.parent)
    handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(part, path)


def make_room(folder: Path, most: int = 500) -> None:
    """Drop the older half of a full cache, compiled code included."""
    sources = [*folder.glob("lugrectl_*.py"), *folder.glob("lugrectl_*.c")]
    if len(sources) < most:
        return
    with contextlib.suppress(OSError):
        for old in sorted(sources, key=lambda path: path.stat().st_mtime)[: most // 2]:
            beside = [
                *(folder / "__pycache__").glob(f"{old.stem}.*"),
                *folder.glob(f"{old.stem}.*"),
            ]
            for made in beside:
                made.unlink()
