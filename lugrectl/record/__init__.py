"""Measured logs: from the columns of a file to a Record in SI units on uniform time."""

from .as_record import consistent, read_log, read_record, record_of
from .columns.names import parse_pairs
from .consistency import refuse_dead
from .log import Log
from .record import Record
from .uniform_time import (
    Stretch,
    long_enough_to_judge,
    pooled,
    refuse_open_time,
    stretches,
)

__all__ = [
    "Log",
    "Record",
    "Stretch",
    "consistent",
    "long_enough_to_judge",
    "parse_pairs",
    "pooled",
    "read_log",
    "read_record",
    "record_of",
    "refuse_dead",
    "refuse_open_time",
    "stretches",
]
