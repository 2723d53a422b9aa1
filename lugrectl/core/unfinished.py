"""Files that are being written: what a killed process leaves is removed by the next one."""

from __future__ import annotations

import contextlib
import os
import platform
import re
import secrets
import shutil
import time
from pathlib import Path

_OLD = 86_400.0  # s after which what another machine left behind is removed
_PREFIX = ".lugrectl-"


def unfinished(folder: Path) -> Path:
    """A new hidden name in a folder, from which those of processes that ended are removed."""
    _clear(folder)
    return folder / f"{_mine(os.getpid())}{secrets.token_hex(6)}"


def _mine(pid: int) -> str:
    """What the hidden names of a process of this machine begin with."""
    host = "".join(c for c in platform.node() if c.isalnum()) or "host"
    return f"{_PREFIX}{host}-{pid}-"


def _clear(folder: Path) -> None:
    """Remove what processes that ended before they could have left."""
    for left in folder.glob(f"{_PREFIX}*"):
        found = re.fullmatch(r"\.lugrectl-\w+-(\d+)-[0-9a-f]{12}", left.name)
        if found is None:
            continue
        pid = int(found[1])
        here = left.name.startswith(_mine(pid))
        if _age(left) > _OLD or (here and not _runs(pid)):
            _remove(left)


def _remove(left: Path) -> None:
    if left.is_dir():
        shutil.rmtree(left, ignore_errors=True)
        return
    with contextlib.suppress(OSError):
        left.unlink()


def _age(path: Path) -> float:
    try:
        return time.time() - path.stat().st_mtime
    except OSError:
        return 0.0


def _runs(pid: int) -> bool:
    """Whether a process of this machine runs; where that cannot be asked, it may."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
