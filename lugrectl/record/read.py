"""From a log to its Record: bad samples left out, uniform time, channels that agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..core.errors import InputError, Refused
from .consistency import audit, fitting_speed, unit_mistake
from .log import Kept, Log, rows_of
from .record import Record
from .samples.usable import usable
from .uniform_time import uniform


def read_record(
    path: Any,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    motion: str | None = None,
) -> Record:
    """Read a measured log: text, JSON, MAT, NPY, NPZ; with ``files`` HDF5, Parquet, Excel.

    Bad samples are found first and left out; the record's messages name them. ``record.log``
    keeps the rows as they were recorded.

    Parameters
    ----------
    path : path, "-", Log, dict of arrays, DataFrame or Record
        A file, "-" for standard input, or the columns themselves: a dict of arrays or a pandas
        DataFrame, whose names may carry units as in a file, ``w [rpm]``. If no column is t, the
        index of a DataFrame is taken for it where it holds times or is named t or time. A Record is
        returned unchanged.
    columns : dict or str, optional
        Role -> name of the column, or its number from 1, for columns not named by their role;
        ``rec.x[2]`` is the second column of the matrix x in the struct rec.
    units : dict or str, optional
        Role -> unit, in place of the unit in the header; without any unit, SI is assumed.
    scale : dict or str, optional
        Role -> factor on the raw value, before the unit; needed for A, V, % and counts. It and the
        two above may be a text such as "t=time,u=torque".
    rate : float, optional
        Sampling rate in Hz, needed when there is no t; a column of t is then not used.
    motion : "rotary" or "linear", optional
        Taken from the units when not given.

    Returns
    -------
    Record
        In SI units on uniform time.

    Raises
    ------
    InputError
        When the file or an argument cannot be read or understood.
    Refused
        When there is no motion in it: a dead channel, or fewer than 12 rows in one piece.

    Examples
    --------
    A log as a drive's scope writes it: motor current and speed in rpm, at 1 kHz. The torque
    constant of the motor is 0.12 N m/A.

    >>> t = 1e-3 * np.arange(500)
    >>> log = {"Iq": 3.0 * np.sin(12.0 * t), "speed": 60.0 * np.sin(12.0 * t - 0.1)}
    >>> record = lg.read_record(
    ...     log, columns="u=Iq,w=speed", units="u=A,w=rpm", scale="u=0.12", rate=1000.0
    ... )
    >>> record.samples, round(float(record.w.max()), 2), round(float(record.u.max()), 2)
    (500, 6.28, 0.36)
    """
    if isinstance(path, Record):
        return already_read(path, columns=columns, units=units, scale=scale, rate=rate)
    if isinstance(path, Log):
        return record_of(path)
    log = read_log(path, columns=columns, units=units, scale=scale, rate=rate, motion=motion)
    return record_of(log)


def read_log(path: Any, **reading: Any) -> Log:
    """Read the rows of a log in SI units; the options are those of :func:`read_record`. Where w and
    d theta/dt differ by a factor of two units, one of them is converted before all else."""
    log = rows_of(path, **reading)
    if not {"w", "theta"} <= set(log.channels):
        return log
    try:
        found = unit_mistake(uniform(usable(log)), log.labels)
    except Refused:  # too short to compare them
        return log
    if found is None:
        return log
    return replace(
        log,
        channels={**log.channels, found.role: log.channels[found.role] * found.factor},
        labels={**log.labels, found.role: found.unit},
        messages=(*log.messages, found.said),
        kept=Kept(),
    )


def record_of(log: Log | Record, *, alone: bool = True) -> Record:
    """A log on uniform time, without its bad samples; Refused where there is no motion in it.
    ``alone``: no other run of the drive stands beside it, whose torque may be another."""
    if isinstance(log, Record):
        return log
    made = audit(_uniform(log), log.labels, alone=alone)
    return replace(made, file=log.file).read_from(log)


def already_read(record: Record, **options: Any) -> Record:
    """A Record as it is; InputError where an option says how to read it."""
    for what, value in options.items():
        if value is not None:
            raise InputError(f"{what} is for a log that is still to be read, not for a Record.")
    return record


def _uniform(log: Log) -> Record:
    record = uniform(usable(log))
    return replace(record, messages=(*log.messages, *record.messages))


def consistent(record: Record, labels: Mapping[str, str | None] | None = None) -> Record:
    """The record on uniform time, without bad samples, and w consistent with d theta/dt; Refused
    if too little is left."""
    log = record.log
    assert log is not None  # a record always has one
    made = record
    if log.channels["u"] is record.u:  # it was never read
        found = _uniform(log)
        if found.messages:
            messages = (*record.messages, *found.messages)
            dropped = record.dropped + found.dropped
            made = replace(found, messages=messages, dropped=dropped, file=record.file)
    made = fitting_speed(made, labels)
    return made if made.log is log else made.read_from(log)
