"""The result of a diagnosis: the verdict, what was found, errors, values, and the plain answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..blocks.model import Model
from ..core.display import Row, estimated
from ..core.provenance import Provenance
from ..core.result import plain as jsonable
from ..core.views import view
from ..estimates.findings import Candidate, Estimate, Finding, FrictionMap, Table, Traces
from ..estimates.fitted import Fitted
from ..record import Record

if TYPE_CHECKING:
    from ..compensated_loop import Compensation
    from ..estimates.balance import Balance
    from ..estimates.comparison import Comparison
    from ..estimates.covariance import Joint, Residuals
    from ..estimates.members import Belief
    from .law_comparison import LawComparison

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
    error: Mapping[str, Any] | None = None
    free_error: Mapping[str, Any] | None = None
    torque_error: Mapping[str, Any] | None = None
    model: Model | None = None
    declared: Model | None = None
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    record: Record | None = None
    messages: tuple[str, ...] = ()
    reason: str | None = None
    ranking: tuple[Candidate, ...] = ()
    traces: Traces | None = None
    table: Table | None = None
    compensation: Compensation | None = None
    map: FrictionMap | None = None
    provenance: Provenance | None = None
    plain: Balance | None = None
    comparison: Comparison | None = None
    joint: Joint | None = None
    residuals: Residuals | None = None
    laws: LawComparison | None = None
    records: tuple[Record, ...] = ()
    rivals: tuple[Belief, ...] = ()
    torque_noise: float | None = None

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        nested = self.model.to_dict() if self.model else {}
        return jsonable(
            {
                "schema": 1,
                "verdict": self.verdict,
                "headline": view("wording.headline")(self)[1],
                "effects": [finding.summary() for finding in self.effects],
                "depends_on": list(self.depends_on),
                "experiment": self.experiment,
                "error": self.error,
                "free_error": self.free_error,
                "torque_error": self.torque_error,
                "model": {k: nested.get(k, {}) for k in ("plant", "friction")}
                | {"effects": nested.get("effects", [])}
                | {"stated": self.model.statements() if self.model else {}},
                "parameters": {k: v.summary() for k, v in self.estimates.items()},
                "ranking": [{"name": c.name, "score": c.score} for c in self.ranking],
                "table": self.table.summary() if self.table else None,
                "compensation": self.compensation.summary() if self.compensation else None,
                "laws": self.laws.summary() if self.laws else None,
                "map": self.map.summary() if self.map else None,
                "record": self.record.summary() if self.record else None,
                "records": self._records(),
                "messages": list(self.messages),
                "reason": self.reason,
                "plain": self.plain.summary() if self.plain else None,
                **_compared(self.comparison),
                "covariance": self.joint.summary() if self.joint else None,
                "members": self._drawn_from(),
                "drive": self._drive(),
                "residuals": self.residuals.summary() if self.residuals else None,
                "provenance": self.provenance.summary() if self.provenance else None,
            }
        )

    def _title(self) -> str:
        names = ", ".join(finding.name for finding in self.effects)
        return f"Diagnosis: {self.verdict}{': ' * bool(names)}{names}"

    def _rows(self) -> Iterable[Row]:
        if self.verdict == "refused":
            rows = [Row("reason", self.reason or "the record cannot answer")]
            rows += [Row("record next", self.experiment)] if self.experiment else []
            return [*rows, *self._last_rows()]
        rows = [
            estimated(f"{finding.name}.{k}", e)
            for finding in self.effects
            for k, e in finding.parameters.items()
        ]
        others = [c.name for finding in self.effects for c in finding.alternatives]
        if others and self.verdict == "ambiguous":
            rows.append(Row("or", ", ".join(others)))
        if self.depends_on:
            rows.append(Row("depends on", ", ".join(self.depends_on)))
        return [*rows, *self._error_rows(("refitted", "augmented")), *self._last_rows()]


def _compared(found: Comparison | None) -> dict[str, Any]:
    """The keys of the JSON format that the comparison fills."""
    if found is None:
        return {"budget": None, "comparison": None, "detectable": None}
    limits = [limit.summary() for limit in found.detectable]
    return {
        "budget": [share.summary() for share in found.budget],
        "comparison": [row.summary() for row in found.rows],
        "detectable": limits if found.verdict == "adequate" else None,
    }
