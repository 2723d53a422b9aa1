"""The result of a diagnosis, and what is said beside an answer: what was noticed, values that
moved, and what to record next."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.model import Model
from ..core.display import Row, estimated, with_interval
from ..core.errors import Refused
from ..core.result import picked
from ..core.views import view
from ..estimates.balance import Balance
from ..estimates.comparison import Comparison
from ..estimates.findings import Candidate, Estimate, Finding, Table
from ..estimates.fitted import Fitted
from ..record import Record
from ..torque_balance.constants import FEW
from ..torque_balance.verdict import PLANT, common_factor
from .asked import Asked

if TYPE_CHECKING:
    from ..bench import Compensation

VERDICTS = ("adequate", "found", "ambiguous", "unexplained", "refused")


@dataclass(frozen=True, repr=False)
class Diagnosis(Fitted):
    """The answer of :func:`lugrectl.diagnose`.

    ``print`` shows it as a report, ``summary`` gives plain Python as in the JSON document.

    Attributes
    ----------
    verdict : str
        "adequate", "found", "ambiguous", "unexplained" or "refused".
    effects : tuple of Finding
        What is missing from the model, with values and with what it may be confused with.
    depends_on : tuple of str
        The signals that the residual torque depends on.
    experiment : str or None
        What to record next.
    error, free_error, torque_error : dict or None
        The mappings of the JSON format: restarted simulation, free run, torque.
    model : Model or None
        The augmented model (the refitted one if nothing was added, None if refused).
    declared : Model or None
        The model as it was declared.
    estimates : dict
        Fitted values with 95 % intervals by key.
    record, records : Record, tuple of Record
        The first run and all runs.
    messages : tuple of str
        What was noticed.
    reason : str or None
        Why the record was refused.
    ranking : tuple of Candidate
        The effects that were tried.
    traces : Traces or None
        The arrays behind the plots.
    table : Table or None
        Offers the unexplained torque as a block.
    compensation, laws : Compensation, LawComparison or None
        Set if they were asked for.
    map : FrictionMap or None
        Set if the records are runs at steady speed.
    provenance : Provenance or None
        Version, date, command and files; None for a result that was put together by hand.
    plain : Balance or None
        The torque balance of the log as it was recorded, there for every log that can be read.
    comparison : Comparison or None
        Each model beside the declared one, and the torque budget.
    joint : Joint or None
        The covariance of the fitted values.
    residuals : Residuals or None
        What one-step predictions leave.
    rivals : tuple of Belief
        The models beside the first one from which :meth:`sample` draws, with their weights.
    torque_noise : float or None
        Standard deviation of the torque that the model does not predict from sample to sample.

    Examples
    --------
    A log that cannot answer, why it cannot, and what to record instead:

    >>> t = 1e-2 * np.arange(400)
    >>> found = lg.diagnose({"t": t, "u": np.zeros(400), "w": np.sin(t)}, lg.table1())
    >>> found.verdict, found.model
    ('refused', None)
    >>> print(found.reason)
    the dict of arrays: u is constant (0): dead torque channel, ...
    >>> print(found.experiment)
    Record a motion that starts, stops and reverses, ...
    """

    verdict: str
    effects: tuple[Finding, ...] = ()
    depends_on: tuple[str, ...] = ()
    experiment: str | None = None
    model: Model | None = field(default=None, kw_only=True)
    free_error: Mapping[str, Any] | None = None
    torque_error: Mapping[str, Any] | None = None
    reason: str | None = None
    ranking: tuple[Candidate, ...] = ()
    table: Table | None = None
    compensation: Compensation | None = None
    comparison: Comparison | None = None

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        own = "verdict effects depends_on experiment free_error torque_error reason ranking table"
        compared = dict.fromkeys(("budget", "comparison", "detectable"))
        compared = compared if self.comparison is None else self.comparison.summary()
        headline = view("wording.headline")(self)[1]
        own = picked(self, f"{own} compensation map")
        return self._document(**own, **compared, headline=headline)

    def _title(self) -> str:
        names = ", ".join(finding.name for finding in self.effects)
        return f"Diagnosis: {self.verdict}{': ' * bool(names)}{names}"

    def _rows(self) -> Iterable[Row]:
        if self.verdict == "refused":
            rows = [Row("reason", self.reason or "the record cannot answer")]
            rows += [Row("record next", self.experiment)] if self.experiment else []
            return [*rows, *self._last_rows()]
        rows = [estimated(f"{one.name}.{k}", e)
                for one in self.effects for k, e in one.parameters.items()]  # fmt: skip
        others = [other.name for one in self.effects for other in one.alternatives]
        if others and self.verdict == "ambiguous":
            rows.append(Row("or", ", ".join(others)))
        if self.depends_on:
            rows.append(Row("depends on", ", ".join(self.depends_on)))
        return [*rows, *self._error_rows(("refitted", "augmented")), *self._last_rows()]


# ---- what is said beside an answer


# what the reader and the balance notice both: the words of the balance are kept
SAME = (
    (r"w lags theta by ", r"w is \S+ ms behind dtheta/dt"),
    (
        r"w is not d theta/dt but \S+ times it: w is ignored",
        r"w is \S+ ms (behind|ahead of) dtheta",
    ),
    (r"w is not d theta/dt but", r"w does not follow d theta/dt"),
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
