"""A warning where a simulation runs for long because the functions of a block are not compiled."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

AFTER = 4.0  # s of wall clock
LONG = "this simulation takes long, because a block is not compiled: {}. Python calls it instead{}."


@contextmanager
def said_if_slow(why: str, how: str = "") -> Iterator[None]:
    """Warn once, after a few seconds, why what runs inside is slow; nothing without a ``why``."""
    timer = Timer(AFTER, _say, (LONG.format(why, f", {how}" if how else ""),))
    timer.daemon = True
    if why:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _say(sentence: str) -> None:
    try:
        warnings.warn(sentence, RuntimeWarning, stacklevel=1)
    except RuntimeWarning:  # the user made errors of warnings, which stop no other thread
        pass
