"""What a user asks about: logs, a model, what is held out; read once, and answered plainly."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ..door import as_holdout, as_logs, as_model
from ..identification.balance import Balance
from ..model import Model
from ..record import Log, Record, record_of
from .plain import plain_answer
from .shifted import in_time


@dataclass(frozen=True)
class Asked:
    """The logs of one drive, the declared model, and what is held out, as the user gave it.

    ``several`` says that a list of runs was given. ``seen`` holds the records read so far.
    """

    logs: tuple[Log | Record, ...]
    several: bool
    model: Model
    held_out: Any = None
    seen: list[Record] = field(default_factory=list)

    @classmethod
    def of(cls, record: Any, model: Any, holdout: Any = None) -> Asked:
        """What is meant; InputError where an argument or a file cannot be understood."""
        made = as_model(model)
        logs, several = as_logs(record, made.motion)
        return cls(logs, several, made, holdout)

    @cached_property
    def plain(self) -> Balance:
        """The torque balance of the logs as they were recorded."""
        logs = [log.log if isinstance(log, Record) else log for log in self.logs]
        return plain_answer([log for log in logs if log is not None], self.model)

    def records(self) -> Record | list[Record]:
        """The logs on uniform time: one record, or a list.

        A torque that was logged late is beside its motion again. Refused where one has no motion.
        """
        for log in self.logs[len(self.seen) :]:
            self.seen.append(in_time(record_of(log), self.plain))
        return self.seen if self.several else self.seen[0]

    def holdout(self) -> str | Record | None:
        """None, "last" or a record of its own."""
        made = as_holdout(self.held_out, self.seen, self.model.motion)
        return in_time(made, self.plain) if isinstance(made, Record) else made
