"""A diagnosis that refuses, with the plain answer beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..blocks.model import Model
from ..core.errors import Refused
from ..estimates.balance import Balance
from ..record import Record
from .duplicate_messages import said_once
from .order_of_notes import grave_first
from .result import Diagnosis

if TYPE_CHECKING:
    from .question import Asked


def refusal(
    no: Refused, model: Model, records: Sequence[Record], plain: Balance | None = None
) -> Diagnosis:
    """The diagnosis "refused" with its reason; ``records`` are those that could be read."""
    notes = plain.said if plain is not None else ()
    said = [message for record in records for message in record.messages]
    return Diagnosis(
        "refused",
        reason=str(no),
        experiment=no.experiment,
        declared=model,
        record=records[0] if records else None,
        records=tuple(records),
        messages=grave_first(m for m in said_once(said, (*notes, str(no))) if m != str(no)),
        plain=plain,
    )


def noted(asked: Any, notes: Sequence[str]) -> tuple[str, ...]:
    """What was noticed of the model and the records, and the notes of an answer, each once."""
    seen = [message for record in asked.seen for message in record.messages]
    said = [*asked.model.remarks(), *seen]
    return grave_first(said_once(said, [*asked.noticed, *notes]))


def with_plain(result: Any, asked: Asked) -> Any:
    """A result with the plain answer beside it, and what was noticed when the logs were read."""
    said = (*asked.plain.reading, *asked.plain.against)
    messages = grave_first(said_once(result.messages, said))
    return replace(result, plain=asked.plain, messages=messages, records=tuple(asked.seen))
