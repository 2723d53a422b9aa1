"""A limit on the time of long work, which then stops itself and says so."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from .errors import Refused
from .option_names import option

_END: ContextVar[float] = ContextVar("end", default=float("inf"))


class OutOfTime(Refused):
    """The work took longer than its limit."""


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Let :func:`check` raise OutOfTime after so many seconds, in this thread of work."""
    token = _END.set(time.monotonic() + seconds)
    try:
        yield
    except OutOfTime as no:
        raise OutOfTime(f"the fit was stopped after {seconds:g} s.", no.experiment) from None
    finally:
        _END.reset(token)


def check() -> None:
    """Raise OutOfTime when the limit has passed."""
    if time.monotonic() > _END.get():
        raise OutOfTime(
            "the fit was stopped at its limit of time.",
            f"Give it more time with {option('time_limit')}, or a shorter part of the record.",
        )
