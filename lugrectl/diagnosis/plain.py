"""The plain answer: the torque balance of a log as it was recorded, beside every finer answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..errors import Refused
from ..identification.balance import Balance, balance, unlike
from ..model import Model
from ..record import Log, Record, stretches
from ..results import Diagnosis

if TYPE_CHECKING:
    from .asking import Asked

LEVELS = ("J", "Fc", "Fv")
TAKEN = "{} is taken as declared, {:.6g} {}: this log does not determine it alone."

OTHERS = "The plain answer is that of the other runs."


def plain_answer(logs: Sequence[Log], model: Model) -> Balance:
    """The balance of runs of one drive, with what was noticed when the logs were read.

    Values that the model holds are known. So is a declared value that the log does not determine
    alone: with Fc declared, one direction is enough for the rest. A run in another unit or sign
    than the others is left out.
    """
    parts, noticed = stretches(logs)
    runs = unlike(parts, model, [log.source for log in logs])
    parts = [part for part in parts if part.run not in runs.left_out]
    noticed = [*runs.said, *([OTHERS] if runs.said else []), *runs.notes, *noticed]
    fixed = {k: v for k, v in model.known().items() if k in model.held()}
    found = balance(parts, model, fixed)
    known = {k: v for k, v in model.known().items() if k in LEVELS and k in found.uncertain}
    taken = [TAKEN.format(k, v, model.unit(k)) for k, v in known.items()]
    if known:
        found = balance(parts, model, fixed | known)
    said = [message for log in logs for message in log.messages]
    return replace(
        found,
        notes=tuple(dict.fromkeys([*found.notes, *taken])),
        reading=tuple(dict.fromkeys([*said, *noticed])),
        stretches=tuple(parts),
        motion=model.motion,
        unlike=runs.said,
    )


def refusal(
    no: Refused, model: Model, records: Sequence[Record], plain: Balance | None = None
) -> Diagnosis:
    """The diagnosis "refused" with its reason; ``records`` are those that could be read."""
    notes = (*plain.reading, *plain.notes) if plain is not None else ()
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
    """A result with the plain answer beside it, and what was noticed when the logs were read."""
    new = [note for note in asked.plain.reading if note not in result.messages]
    return replace(result, plain=asked.plain, messages=(*result.messages, *new))
