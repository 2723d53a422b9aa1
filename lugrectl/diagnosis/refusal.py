"""The notes of an answer, and the diagnosis that refuses, with the plain answer beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from ..blocks.model import Model
from ..core.errors import Refused
from ..estimates.balance import Balance
from ..record import Record
from .result import Diagnosis

# how such a note begins, behind the name of its log where there are several, the gravest first
GRAVE = (
    r"The header says ",  # another unit was given than the log states
    r"\w+ is stated in \S+ but in fact in ",  # the data contradict it
    r"u and \w+ seem to be swapped",
    r"The declared law '\S+' (has no \w+ friction|does not fit)",
    r"The errors of a simulation are left out",
    r"The values are those of the torque balance alone",
    r"On held-out samples the simulation with the added effect misses",
)
# what the reader and the balance notice both: the words of the balance are kept
ALIKE = (
    (r"w lags theta by ", r"w is \S+ ms behind dtheta/dt"),
    (
        r"w is not d theta/dt but \S+ times it: w is ignored",
        r"w is \S+ ms (behind|ahead of) dtheta",
    ),
    (r"its sign was changed for the simulation", r"u has the wrong sign"),
)


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


def grave_first(notes: Iterable[str]) -> tuple[str, ...]:
    """The notes, those first that say why the values or names may be wrong."""
    return tuple(sorted(notes, key=_rank))


def _rank(note: str) -> int:
    """The place of a note's kind; that of all which are not grave is the last."""
    found = (i for i, start in enumerate(GRAVE) if re.match(rf"(\S.*?: )?{start}", note))
    return next(found, len(GRAVE))


def said_once(said: Sequence[str], notes: Sequence[str]) -> tuple[str, ...]:
    """The sentences of the reader, then those of an answer, each thing said once.

    A sentence on one of several logs stands with the name of that log only.
    """
    bare = {note.split(": ", 1)[1] for note in notes if ": " in note}
    kept = [s for s in said if s not in bare and not any(_same(s, n) for n in notes)]
    return tuple(dict.fromkeys([*kept, *notes]))


def _same(sentence: str, note: str) -> bool:
    return any(re.search(mine, sentence) and re.search(its, note) for mine, its in ALIKE)
