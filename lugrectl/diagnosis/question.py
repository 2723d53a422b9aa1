"""What a user asks about: logs, a model, what is held out; read once, and answered plainly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ..blocks.model import Model, as_model
from ..core.errors import Refused
from ..core.validation import positive, whole
from ..identification.balance import Balance
from ..identification.selection import completed
from ..record import Log, Record, record_of, refuse_dead, refuse_open_time, refuse_unlikely_time
from ..record.as_record import as_holdout, as_logs
from .plain_answer import plain_answer
from .swapped import refuse_swapped


@dataclass(frozen=True)
class Asked:
    """The logs of one drive, the declared model, and what is held out, as the user gave it.

    ``several`` says that a list of runs was given. ``reading`` are the options of
    :func:`lugrectl.read_record`. ``seen`` holds the records read so far.
    """

    logs: tuple[Log | Record, ...]
    several: bool
    model: Model
    held_out: Any = None
    reading: Mapping[str, Any] = field(default_factory=dict)
    seen: list[Record] = field(default_factory=list)

    @classmethod
    def of(cls, record: Any, model: Any, holdout: Any = None, **reading: Any) -> Asked:
        """What is meant; InputError where an argument or a file cannot be understood."""
        refuse_swapped([record], model)
        made = as_model(model)
        logs, several = as_logs(record, made.motion, **reading)
        return cls(logs, several, made, holdout, reading)

    @cached_property
    def plain(self) -> Balance:
        """The torque balance of the logs as they were recorded."""
        logs = [log.log if isinstance(log, Record) else log for log in self.logs]
        return plain_answer([log for log in logs if log is not None], self.model)

    @cached_property
    def completed(self) -> Model:
        """The model with values of the effects that it leaves open, where a search finds them."""
        plain = self.plain
        return self.model.with_values(completed(plain.stretches, self.model, plain))

    def starts(self, friction: Mapping[str, float]) -> dict[str, float]:
        """Values from which a fit starts: of the plain answer, of effects declared without values,
        and inertia and friction as the comparison has them."""
        own = self.model.values()
        left_open = {k: v for k, v in self.completed.known().items() if own[k] is None}
        return {**self.plain.values(), **friction, **left_open}

    def records(self) -> Record | list[Record]:
        """The logs on uniform time: one record, or a list; Refused where one has no motion."""
        for log in self.logs[len(self.seen) :]:
            self.seen.append(record_of(log, alone=len(self.logs) == 1))
        return self.seen if self.several else self.seen[0]

    def refuse_unfit(self) -> None:
        """Raise Refused where records of one motion show a dead channel, or t in an open unit."""
        refuse_dead(self.seen)
        for one in self.seen:
            refuse_unlikely_time(one)

    def holdout(self) -> str | Record | None:
        """None, "last" or a record of its own."""
        return as_holdout(self.held_out, self.seen, self.model.motion, **self.reading)


def balanced(record: Any, model: Any, reading: Mapping[str, Any]) -> Balance:
    """The plain torque balance of a log."""
    asked = Asked.of(record, {} if model is None else model, **reading)
    try:  # of runs at steady speed only means count
        for part in asked.plain.stretches if not asked.plain.is_map else ():
            log = asked.logs[part.run]
            refuse_open_time(log.source, getattr(log, "labels", {}), part.dt)
    except Refused as no:  # all rates and the inertia depend on it: no value is an answer
        no.plain = asked.plain
        raise
    return asked.plain


def judged_by(horizon: Any, seed: Any) -> tuple[float, int]:
    """The time between restarts in s, and the seed."""
    return positive(horizon, "horizon", "seconds"), whole(seed, "seed")
