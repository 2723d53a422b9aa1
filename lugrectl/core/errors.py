"""The two ways in which an input can fail, each with its exit code, and one warning."""

from __future__ import annotations

from typing import Any

UNEXPECTED, INTERRUPTED, BROKEN_PIPE = 70, 130, 141  # exit codes of what is no error of the input


class InputError(ValueError):
    """Wrong usage, or a file that cannot be read or understood (exit code 2)."""

    exit_code = 2


class NotLoaded(UserWarning):
    """The blocks of an installed package are not there."""


class Refused(ValueError):
    """A readable record that cannot answer the question (exit code 3).

    ``experiment`` says in one sentence what to record instead, if that is known; ``plain`` is
    the torque balance of the log, where it was computed.
    """

    exit_code = 3
    plain: Any = None

    def __init__(self, reason: str, experiment: str | None = None) -> None:
        super().__init__(reason)
        self.experiment = experiment


class Diverged(Refused):
    """The solution of a system cannot be continued: it grows without bound, becomes NaN, or
    changes faster than steps can follow."""
