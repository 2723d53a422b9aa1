"""The cache directory of generated code."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path


def cache_dir() -> Path:
    """The directory of generated code: $LUGRECTL_CACHE, else the user's cache directory.

    A temporary directory of this process if neither can be written.
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


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A temporary file that is renamed at the end: other processes see all of it or nothing."""
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    os.close(handle)
    part = Path(name)
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def keep(path: Path, text: str) -> None:
    """Write generated code to a file of the cache."""
    make_room(path.parent)
    with whole(path) as part:
        part.write_text(text, encoding="utf-8")


def make_room(folder: Path, most: int = 500) -> None:
    """Delete the older half of a full cache, compiled code included."""
    sources = [*folder.glob("lugrectl_*.py"), *folder.glob("lugrectl_*.c")]
    if len(sources) < most:
        return
    with contextlib.suppress(OSError):
        for old in sorted(sources, key=lambda path: path.stat().st_mtime)[: most // 2]:
            for place in (folder, folder / "__pycache__"):
                for made in place.glob(f"{old.stem}.*"):
                    made.unlink()
