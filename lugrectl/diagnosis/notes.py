"""What is said beside an answer: what was noticed, values that moved, and what to record next."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..blocks.model import Model
from ..core.display import with_interval
from ..core.errors import Refused
from ..estimates.balance import Balance
from ..estimates.findings import Estimate, Finding
from ..record import Record
from ..torque_balance.constants import FEW
from ..torque_balance.verdict import PLANT, common_factor
from .asked import Asked
from .result import Diagnosis

# what the reader and the balance notice both: the words of the balance are kept
SAME = (
    (r"w lags theta by ", r"w is \S+ ms behind dtheta/dt"),
    (
        r"w is not d theta/dt but \S+ times it: w is ignored",
        r"w is \S+ ms (behind|ahead of) dtheta",
    ),
    (r"w is not d theta/dt but", r"w does not follow d theta/dt"),
    (r"its sign was changed for the simulation", r"u has the wrong sign"),
)

FAR = 0.2  # of the declared value, from which a change may have the causes below
NEAR = 1e-4  # of a bound: at it
AT = "{} lies at its declared {} = {:.6g}: the record would take it further."
MOVED = "{} is {} [{}], declared {:.6g}"
LEFT = "The record moves declared values beyond their 95 % intervals: {}."
SCALE = (
    "all by the factor {:.3g}: if the declared values are right, the scale of u is wrong (torque "
    "constant, gear ratio)"
)
ADVICE = {  # if the residual depends on several of these signals, the first one counts
    "t": "repeat the same run, cold and warm, and log temperature and load as well. What returns "
    "at the same times depends on the motion",
    "theta": "record slow moves over the same positions, in both directions and at two speeds",
    "a": "record the same move at two accelerations",
    "u": "record the same motion with a known added load, so that torque and motion differ",
    "w": "record constant speeds, from slow to fast, in both directions",
}
INERTIA = "Record a motion that starts, stops and changes its speed fast: it shows the inertia."
LEAST = 18.0  # s of motion with which a model can be fitted and checked on held-out samples
SHORT = (
    "The record is short: {0:.3g} s, in which {1} independent stretches of motion were compared. "
    "With fewer than {2} the comparison is uncertain."
)
LONGER = "Record {:.0f} s or more of such motion first: this record is short."


def refusal(
    no: Refused, model: Model, records: Sequence[Record], plain: Balance | None = None
) -> Diagnosis:
    """The diagnosis "refused" with its reason; ``records`` are those that could be read."""
    said = [message for record in records for message in record.messages]
    notes = said_once(said, [*(plain.said if plain else ()), str(no)])
    return Diagnosis(
        "refused",
        reason=str(no),
        experiment=no.experiment,
        declared=model,
        record=records[0] if records else None,
        records=tuple(records),
        messages=tuple(note for note in notes if note != str(no)),
        plain=plain,
    )


def noted(asked: Asked, notes: Sequence[str]) -> tuple[str, ...]:
    """What was noticed of the model and the records, and the notes of an answer, each once."""
    seen = [message for record in asked.seen for message in record.messages]
    return said_once([*asked.model.remarks(), *seen], [*notes, *asked.noticed])


def said_once(said: Sequence[str], notes: Sequence[str]) -> tuple[str, ...]:
    """The sentences of an answer, then those of the reader, each thing said once, on one of several
    logs with its name only."""
    bare = {note.split(": ", 1)[1] for note in notes if ": " in note}
    kept = [s for s in said if s not in bare and not any(_same(s, n) for n in notes)]
    return tuple(dict.fromkeys([*notes, *kept]))


def _same(sentence: str, note: str) -> bool:
    return any(re.search(mine, sentence) and re.search(its, note) for mine, its in SAME)


# ---- values that moved


def moved(found: Mapping[str, Estimate], declared: Model) -> list[str]:
    """Sentences on the declared values that lie outside the intervals of an answer, with both
    values, and what could be the cause of large changes; and on values at a stated bound."""
    old = _left(found, declared)
    said = [_changed(key, found[key], value, declared.unit(key)) for key, value in old.items()]
    factors = {k: found[k].value / old[k] for k in (*PLANT, "Fs") if k in old}
    large = {k: x for k, x in factors.items() if abs(x - 1.0) > FAR}
    if factor := common_factor(large):
        said.append(SCALE.format(factor))
    notes = [LEFT.format("; ".join(said))] if said else []
    for key, one in declared.stated.items():
        for name, end in (("min", one.low), ("max", one.high)):
            value = found[key].value if key in found else np.nan
            if end is not None and math.isclose(value, end, rel_tol=NEAR):
                notes.append(AT.format(key, name, end))
    return notes


def _left(found: Mapping[str, Estimate], declared: Model) -> dict[str, float]:
    """The declared values, without the held ones, that the fit left beyond their intervals."""
    declarations, held = declared.declarations(), declared.held()
    known = {k: x for k, x in declared.known().items() if k in found and k not in held}
    turns = {k: (-1, 0, 1) if declarations[k].angle else (0,) for k in known}  # the same angle
    return {k: old for k, old in known.items() if found[k].ci95 and math.isfinite(old)
            and not any(_agrees(old + 2.0 * np.pi * n, found[k]) for n in turns[k])}  # fmt: skip


def _agrees(declared: float, found: Estimate) -> bool:
    """Whether a value lies in an interval, or prints as the fitted one: that is no news."""
    return found.may_be(declared) or f"{declared:.3g}" == f"{found.value:.3g}"


def _changed(key: str, found: Estimate, declared: float, unit: str) -> str:
    """ "J is 0.0022 [0.0021, 0.0023], declared 0.002 kg m2"."""
    value, interval = with_interval(found)
    said = MOVED.format(key, value, interval.replace(" to ", ", "), declared)
    return said if unit == "1" else f"{said} {unit}"


# ---- what to record next


def short(records: Iterable[Record], stretches: int | None) -> tuple[str, ...]:
    """A sentence where so few independent stretches were compared that an answer is uncertain."""
    seconds = sum(record.duration for record in records)
    if stretches is None or stretches >= FEW or seconds >= LEAST:
        return ()
    return (SHORT.format(seconds, stretches, FEW),)


def longer(records: Sequence[Record], stretches: int | None, then: str | None) -> str | None:
    """What to record next: where a record is short, more of it, and then what ``then`` says."""
    if not short(records, stretches) or not stretches:
        return then
    seconds = sum(record.duration for record in records)
    first = LONGER.format(max(LEAST, math.ceil(seconds * FEW / stretches)))
    return " ".join(filter(None, (first, then)))


def next_experiment(
    verdict: str, depends_on: Sequence[str], effects: Sequence[Finding], plain: Balance, sure: bool
) -> str | None:
    """One sentence; None where nothing is open."""
    apart = next(filter(None, (finding.apart() for finding in effects)), "")
    if verdict == "ambiguous" and apart:
        return f"{apart[0].upper()}{apart[1:]}."
    if verdict == "unexplained":
        known = (said for k, said in ADVICE.items() if k in depends_on)
        return f"To identify the missing effect: {next(known, ADVICE['a'])}."
    if not (sure or plain.is_map):
        return INERTIA
    how = next((c.to_separate for c in plain.combinations if c.to_separate), "")
    return f"{how[0].upper()}{how[1:]}, too." if how else None
