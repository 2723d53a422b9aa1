"""The result of a diagnosis: the verdict, what was found, errors, values, and the plain answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..blocks.model import Model
from ..core.display import Row, estimated
from ..core.result import picked
from ..core.views import view
from ..estimates.comparison import Comparison
from ..estimates.findings import Candidate, Finding, Table
from ..estimates.fitted import Fitted

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
