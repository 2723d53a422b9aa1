"""The result of a diagnosis, and what is said beside an answer: what was noticed, values that
moved, and what to record next."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.model import Model
from ..core.display import Row, estimated, with_interval
from ..core.errors import Refused
from ..core.result import picked
from ..core.views import view
from ..estimates.findings import Balance, Candidate, Comparison, Estimate, Finding, Table
from ..estimates.fitted import Fitted
from ..record import Record
from ..torque_balance.constants import FEW
from ..torque_balance.verdict import PLANT, common_factor
from .asked import FARTHER, Asked

if TYPE_CHECKING:
    from ..bench.compensate import Compensation

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
        none = dict.fromkeys(("budget", "comparison", "detectable"))
        compared = self.comparison.summary() if self.comparison else none
        headline = view("wording.headline")(self)[1]
        own = picked(self, f"{own} compensation map")
        return self._document(**own, **compared, headline=headline)

    def _title(self) -> str:
        names = ", ".join(finding.name for finding in self.effects)
        return f"Diagnosis: {self.verdict}{': ' * bool(names)}{names}"

    def _rows(self) -> Iterable[Row]:
        others = [other.name for one in self.effects for other in one.alternatives]
        said = {
            "reason": self.reason,
            "record next": self.reason and self.experiment,
            "or": others if self.verdict == "ambiguous" else None,
            "depends on": ", ".join(self.depends_on),
        }
        rows = [estimated(f"{one.name}.{k}", e)
                for one in self.effects for k, e in one.parameters.items()]  # fmt: skip
        rows += [Row(name, value) for name, value in said.items() if value]
        return [*rows, *self._last_rows("refitted", "augmented")]


# ---- what is said beside an answer


FAR = 0.2  # of the declared value, from which a change may have the causes below
NEAR = 1e-4  # of a bound: at it
AT = "{} lies at its declared {} = {:.6g}: the record would take it further."
MOVED = "{} is {} [{}], declared {:.6g}"
LEFT = "The record moves declared values beyond their 95 % intervals: {}."
SCALE = (
    "all by the factor {:.3g}: if the declared values are right, the scale of u is wrong (torque "
    "constant, gear ratio)"
)
UNITS = "A factor of {:.3g} in {} is often a unit: see units, as theta=deg, w=rpm or u=mN m."
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
    """The sentences of an answer, then those of the reader, each once and with the log's name."""
    bare = {note.split(": ", 1)[1] for note in notes if ": " in note}
    kept = [s for s in said if s not in bare]
    return tuple(dict.fromkeys([*notes, *kept]))


# ---- values that moved


def moved(found: Mapping[str, Estimate], declared: Model) -> list[str]:
    """Sentences on declared values outside the intervals of an answer, and on those at a bound."""
    known, own, held = declared.known(), declared.declarations(), declared.held()
    old, said = dict[str, float](), list[str]()
    for key in (k for k in known if k in found and k not in held and math.isfinite(known[k])):
        e, value, unit = found[key], known[key], declared.unit(key)
        same = [value + 2.0 * np.pi * n for n in ((-1, 0, 1) if own[key].angle else (0,))]
        # what lies in the interval, or prints as the fitted value, is no news
        if e.ci95 and not any(e.may_be(x) or f"{x:.3g}" == f"{e.value:.3g}" for x in same):
            shown, interval = with_interval(e)
            text = MOVED.format(key, shown, interval.replace(" to ", ", "), value)
            old[key] = value
            said.append(text if unit == "1" else f"{text} {unit}")
    factors = {k: found[k].value / old[k] for k in (*PLANT, "Fs") if old.get(k)}
    large = {k: x for k, x in factors.items() if abs(x - 1.0) > FAR}
    if factor := common_factor(large):
        said.append(SCALE.format(factor))
    notes = [LEFT.format("; ".join(said))] if said else []
    notes += [UNITS.format(x, k) for k, x in factors.items() if not 1 / FARTHER < x < FARTHER][:1]
    for key, one in declared.stated.items():
        for name, end in (("min", one.low), ("max", one.high)):
            value = found[key].value if key in found else np.nan
            if end is not None and math.isclose(value, end, rel_tol=NEAR):
                notes.append(AT.format(key, name, end))
    return notes


# ---- what to record next


def short(
    records: Sequence[Record], stretches: int | None, then: str | None
) -> tuple[list[str], str | None]:
    """What to say where so few independent stretches were compared that an answer is uncertain, and
    what to record next: then more of it first, and then what ``then`` says."""
    seconds = sum(record.duration for record in records)
    if stretches is None or stretches >= FEW or seconds >= LEAST:
        return [], then
    said = [SHORT.format(seconds, stretches, FEW)]
    first = LONGER.format(max(LEAST, math.ceil(seconds * FEW / max(stretches, 1))))
    return said, " ".join(filter(None, (first, then)))


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
