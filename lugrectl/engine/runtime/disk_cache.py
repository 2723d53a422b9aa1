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
    if os.name == "nt":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return _usable(os.environ.get("LUGRECTL_CACHE") or str(Path(base) / "lugrectl"))


@cache
def temporary() -> Path:
    """A directory that ends with this process, for when the cache's disk is full."""
    made = tempfile.TemporaryDirectory(prefix="lugrectl-", ignore_cleanup_errors=True)
    atexit.register(made.cleanup)
    return Path(made.name)


@cache
def _usable(wanted: str) -> Path:
    for path in (Path(wanted), Path(f"{wanted}-own")):
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.mkdir(mode=0o700, exist_ok=True)
            found = path.stat()
            # only this user (and the administrator) may put code into it
            if os.name != "posix" or (found.st_uid == os.getuid() and not found.st_mode & 0o022):
                with tempfile.TemporaryFile(dir=path):
                    return path
    return temporary()


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


def _seal(path: Path) -> tuple[Path, str]:
    """The file beside a compiled one that says what it is, and what that is now."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return path.with_suffix(path.suffix + ".sha256"), digest


def seal(path: Path) -> None:
    """Write down what a compiled file is now."""
    place, digest = _seal(path)
    with whole(place) as part:
        part.write_text(digest)


def is_sound(path: Path) -> bool:
    """Whether a compiled file is what it was when it was made."""
    try:
        place, digest = _seal(path)
        return place.read_text() == digest
    except (OSError, UnicodeDecodeError):
        return False


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
