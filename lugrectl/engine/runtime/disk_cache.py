"""The cache directory of generated code: what is loaded from it is checked first."""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import sys
import tempfile
from functools import cache
from pathlib import Path

from ...core.writing import whole as written_whole


def cache_dir() -> Path:
    """The directory of generated code: $LUGRECTL_CACHE, else the user's cache directory.

    Where others can write to it, one of its own beside it; a temporary directory of this process
    if none can be written.
    """
    return _usable(os.environ.get("LUGRECTL_CACHE") or str(_user_cache()))


@cache
def temporary() -> Path:
    """A directory that ends with this process, for when the cache's disk is full."""
    made = tempfile.TemporaryDirectory(prefix="lugrectl-", ignore_cleanup_errors=True)
    atexit.register(made.cleanup)
    return Path(made.name)


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
    for path in (Path(wanted), Path(f"{wanted}-own")):
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.mkdir(mode=0o700, exist_ok=True)
            if _is_own(path):
                with tempfile.TemporaryFile(dir=path):
                    return path
    return temporary()


def _is_own(path: Path) -> bool:
    """Whether only this user (and the administrator) can put code into a folder."""
    if os.name != "posix":
        return True
    found = path.stat()
    return found.st_uid == os.getuid() and not found.st_mode & 0o022


def whole(path: Path) -> contextlib.AbstractContextManager[Path]:
    """A temporary file that is renamed at the end: other processes see all of it or nothing."""
    return written_whole(path, 0o600)


def keep(path: Path, text: str) -> None:
    """Write generated code to a file of the cache, where it is not there already."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        if path.read_text(encoding="utf-8") == text:
            return
    make_room(path.parent)
    with whole(path) as part:
        part.write_text(text, encoding="utf-8")


def seal(path: Path) -> None:
    """Write down what a compiled file is now."""
    with whole(_seal(path)) as part:
        part.write_text(_digest(path))


def is_sound(path: Path) -> bool:
    """Whether a compiled file is what it was when it was made."""
    try:
        return _seal(path).read_text() == _digest(path)
    except (OSError, UnicodeDecodeError):
        return False


def _seal(path: Path) -> Path:
    return path.with_suffix(path.suffix + ".sha256")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


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
