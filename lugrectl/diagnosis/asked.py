"""What a user asks about: logs, a model, what is held out; read once, and answered plainly."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

from ..blocks.model import Model, as_model
from ..core.errors import InputError, Refused
from ..core.validation import is_file, positive, whole
from ..estimates.balance import Balance
from ..estimates.bench_test import BenchTest
from ..record import Log, Record, Stretch, record_of, refuse_open_time, stretches
from ..record.as_record import as_holdout, as_logs
from ..record.files.readers import MODEL, SUFFIXES
from ..torque_balance.bench_tests import bench_tests
from ..torque_balance.maps import is_map
from .contradictions import checked, doubtful, far_off

SAME_UNITS = "Give all runs in one unit and sign, or leave out the run that differs."


@dataclass(frozen=True)
class Asked:
    """The logs of one drive, the declared model, and what is held out, as the user gave it."""

    logs: tuple[Log | Record, ...]
    model: Model
    held_out: Any = None
    reading: Mapping[str, Any] = field(default_factory=dict)  # options of read_record
    seen: list[Record] = field(default_factory=list)  # records read so far

    @classmethod
    def of(cls, record: Any, model: Any, holdout: Any = None, **reading: Any) -> Asked:
        """What is meant; InputError where an argument or a file cannot be understood."""
        refuse_swapped([record], model)
        made = as_model(model)
        return cls(as_logs(record, made.motion, **reading), made, holdout, reading)

    @property
    def _as_recorded(self) -> list[Log]:
        logs = [log.log if isinstance(log, Record) else log for log in self.logs]
        return [log for log in logs if log is not None]

    @cached_property
    def _read(self) -> tuple[list[Stretch], list[str]]:
        return stretches(self._as_recorded)

    @property
    def stretches(self) -> list[Stretch]:
        return self._read[0]

    @property
    def noticed(self) -> tuple[str, ...]:
        logs = self._as_recorded
        common = set(logs[0].messages).intersection(*(log.messages for log in logs))
        reading = [m if m in common else f"{log.source}: {m}" for log in logs for m in log.messages]
        return tuple(dict.fromkeys([*reading, *self._read[1]]))

    @cached_property
    def plain(self) -> Balance:
        """The torque balance of the declared model: the base row of the table, with what makes the
        log impossible."""
        start = perf_counter()
        made = checked(self.stretches, self.model, [log.source for log in self.logs])
        return self.completed(made, perf_counter() - start)

    def doubts(self, answer: Balance | None = None) -> tuple[str, ...]:
        """What the log says against the model, asked of several runs and of held values, and where
        an ``answer`` is doubtful or far from what is declared; Refused where the log is impossible
        as it was given."""
        stated = any(s.fixed or s.bounded for s in self.model.stated.values())
        odd = answer is not None and (doubtful(answer) or far_off(answer, self.model))
        if not (stated or len(self.logs) > 1 or odd):
            return ()
        if self.plain.unlike:
            raise Refused(" ".join(self.plain.unlike), SAME_UNITS)
        if self.plain.hopeless:
            raise Refused(" ".join(self.plain.against))
        return self.plain.against

    def completed(self, plain: Balance, seconds: float) -> Balance:
        """A plain answer with bench tests and what was noticed when the logs were read."""
        return replace(plain, seconds=seconds, reading=self.noticed, bench_tests=self.bench_tests)

    @cached_property
    def bench_tests(self) -> tuple[BenchTest, ...]:
        return bench_tests(self._as_recorded, self.model)

    def records(self) -> list[Record]:
        """The logs on uniform time; Refused where one has no motion."""
        for log in self.logs[len(self.seen) :]:
            self.seen.append(record_of(log, alone=len(self.logs) == 1))
        return self.seen

    def holdout(self) -> str | Record | None:
        """None, "last" or a record of its own."""
        return as_holdout(self.held_out, self.seen, self.model.motion, **self.reading)

    def refuse_open_time(self) -> None:
        """Raise Refused where t has no unit, and no drive writes a log at that rate in s; of a run
        at a steady speed only the mean counts."""
        for part in () if is_map(self.stretches) else self.stretches:
            log = self.logs[part.run]
            refuse_open_time(log.source, getattr(log, "labels", {}), part.dt)


def plain_answer(logs: Sequence[Log], model: Model) -> Balance:
    return Asked(tuple(logs), model).plain


def judged_by(horizon: Any, seed: Any) -> tuple[float, int]:
    return positive(horizon, "horizon", "seconds"), whole(seed, "seed")


def refuse_swapped(logs: Iterable[Any], model: Any) -> None:
    """InputError where the model is the file of a log, and one of the logs that of a model."""
    if is_file(model) and Path(model).suffix.lower() in SUFFIXES:
        for log in logs:
            if is_file(log) and Path(log).suffix.lower() == MODEL:
                raise InputError(f"{log} is a model and {model} is a log: swap them.")
