"""What a user asks about: logs, a model, what is held out; read once, and answered plainly by the
torque balance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

from ..blocks.model import Model, as_model
from ..core.blas_threads import one_blas_thread
from ..core.errors import InputError, Refused
from ..core.validation import is_file, positive, share, whole
from ..estimates.balance import Balance, BenchTest
from ..record import Log, Record, Stretch, record_of, refuse_open_time, stretches
from ..record.as_record import as_holdout, as_logs
from ..record.files.readers import MODEL, SUFFIXES
from ..torque_balance.bench_tests import bench_tests
from ..torque_balance.constants import ALPHA, FLOOR
from ..torque_balance.maps import is_map
from .contradictions import checked, doubtful, far_off

LIMIT = 270.0  # s that the answer may take
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


def settings(
    horizon: Any = 1.0,
    seed: Any = 0,
    least: Any = FLOOR,
    alpha: Any = ALPHA,
    time_limit: Any = LIMIT,
    **_: Any,
) -> tuple[float, float, float, float]:
    """horizon, least, alpha and time_limit; InputError for what cannot be meant."""
    horizon, _ = positive(horizon, "horizon", "seconds"), whole(seed, "seed")
    limit = positive(time_limit, "time_limit", "seconds")
    return horizon, share(least, "least"), share(alpha, "alpha"), limit


def refuse_swapped(logs: Iterable[Any], model: Any) -> None:
    """InputError where the model is the file of a log, and one of the logs that of a model."""
    if is_file(model) and Path(model).suffix.lower() in SUFFIXES:
        for log in logs:
            if is_file(log) and Path(log).suffix.lower() == MODEL:
                raise InputError(f"{log} is a model and {model} is a log: swap them.")


@one_blas_thread()
def balance(
    record: Any,
    model: Any = None,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
) -> Balance:
    """The plain torque balance of a log, as it stands beside every diagnosis; in a second.

        u(t - T) = J dw/dt + Fc sign(w) + Fv w + constant + declared effects + residual

    in means over windows, by one robust regression: the first row of the table of
    :func:`lugrectl.diagnose`. An effect that is not declared biases the values beyond their
    intervals.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        The runs of one drive.
    model : Model, Parameters, dict or path
        The declared model: its effects are further terms, its held values are known. None:
        nothing is known.
    columns, units, scale, rate : optional
        How to read a log, as for :func:`lugrectl.read_record`.

    Returns
    -------
    Balance
        ``parameters`` with 95 % intervals, SI (J in kg m2, Fc in N m, Fv in N m s/rad, u_delay in
        s; on a linear axis kg, N, N s/m, s), the sums that are certain, the friction curve.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When t has no unit, and no drive writes a log at that rate in s.

    Examples
    --------
    A made-up log of a drive with J = 0.002 kg m2, Fc = 0.3 N m and Fv = 0.02 N m s/rad:

    >>> t = 4e-3 * np.arange(3000)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.sign(w) + 0.02 * w
    >>> plain = lg.balance({"t": t, "u": u, "w": w})
    >>> round(plain.parameters["Fc"].value, 2), round(plain.parameters["Fv"].value, 2)
    (0.3, 0.02)
    """
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    asked = Asked.of(record, {} if model is None else model, **reading)
    try:
        asked.refuse_open_time()
    except Refused as no:  # all rates and the inertia depend on it: no value is an answer
        no.plain = asked.plain
        raise
    return asked.plain
