"""The plain answer: the torque balance of a log as it was recorded, beside every finer answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..errors import Refused
from ..identification.balance import Balance, balance
from ..model import Model
from ..record import Log, Record, Stretch, stretches
from ..results import Diagnosis

if TYPE_CHECKING:
    from .asking import Asked

NOTHING = "Nothing is certain from this log: see the notes."


def plain_answer(logs: Sequence[Log], model: Model) -> tuple[Balance, list[Stretch]]:
    """The balance of runs of one drive, and the stretches that it was computed from.

    The notes of the balance say first how the logs were read.
    """
    parts, noticed = stretches(logs)
    found = balance(parts, model)
    said = [message for log in logs for message in log.messages]
    notes = tuple(dict.fromkeys([*said, *noticed, *found.notes]))
    return replace(found, notes=notes), parts


def refusal(
    no: Refused, model: Model, records: Sequence[Record], plain: Balance | None = None
) -> Diagnosis:
    """The diagnosis "refused" with its reason; ``records`` are those that could be read."""
    notes = plain.notes if plain is not None else ()
    said = [message for record in records for message in record.messages]
    return Diagnosis(
        "refused",
        reason=str(no),
        experiment=no.experiment,
        declared=model,
        record=records[0] if records else None,
        messages=tuple(dict.fromkeys([*said, *notes])),
        plain=plain,
    )


def with_plain(result: Any, asked: Asked) -> Any:
    """A result with the plain answer beside it, and what only that noticed."""
    new = [note for note in asked.plain.notes if note not in result.messages]
    return replace(result, plain=asked.plain, messages=(*result.messages, *new))
