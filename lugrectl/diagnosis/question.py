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

        u(t - T) = J dw/dt + Fc sign(w) + Fv w + constant + gravity(theta) + effects + residual

    in means over windows, by a robust regression: see :mod:`lugrectl.identification.balance`.
    An effect that is neither declared nor a term biases the values beyond their intervals.

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
