"""A record that is short: how long it is, how much of it was compared, how long to record next."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..identification.regression.numbers import FEW_STRETCHES
from ..record import Record

LEAST = 18.0  # s of motion with which a model can be fitted and checked on held-out samples
SHORT = (
    "The record is short: {0:.3g} s, in which {1} of motion {2} compared. With fewer than {3} the "
    "comparison is uncertain."
)
LENGTH = "The record has {0:.3g} s, in which {1} of motion {2} compared."
LONGER = "Record {:.0f} s or more of such motion first: this record is short."
STILL = "Record {:.0f} s or more in which the drive moves most of the time: here it hardly does."


def short(stretches: int) -> bool:
    """Whether so few independent stretches were compared that the answer is uncertain."""
    return stretches < FEW_STRETCHES


def said(records: Sequence[Record], stretches: int) -> str:
    """How long the records are and how many independent stretches of them were compared."""
    what = f"{stretches} independent stretch{'es' * (stretches != 1)}"
    were = "was" if stretches == 1 else "were"
    sentence = SHORT if short(stretches) else LENGTH
    return sentence.format(_duration(records), what, were, FEW_STRETCHES)


def longer(records: Sequence[Record], stretches: int, then: str | None = None) -> str:
    """What to record next: more of the same motion, and then what ``then`` says."""
    if not stretches:  # then its length says nothing
        first = STILL.format(LEAST)
    else:
        first = LONGER.format(max(LEAST, math.ceil(_duration(records) * FEW_STRETCHES / stretches)))
    return " ".join(filter(None, (first, then)))


def _duration(records: Sequence[Record]) -> float:
    return sum(record.summary()["duration"] for record in records)
