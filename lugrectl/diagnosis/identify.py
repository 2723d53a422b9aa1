"""Fit the declared model alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..blas import one_blas_thread
from ..display import Row, estimated
from ..door import asked, judged_by
from ..friction_map import (
    Fits,
    begin_map,
    errors_of,
    estimates_of,
    final_model,
    map_of,
    messages_of,
)
from ..model import Model
from ..outputs import Fitted, plain
from ..progress import Wanted, reporter, shows_progress
from ..provenance import Provenance, stamped
from ..record import Record
from ..results import Estimate, FrictionMap, Traces
from ..steady.curve import refit
from ..steady.points import is_map
from ..traces import traces
from ..tracing.far import against_held, at_bounds, far_off
from ..tracing.job import begin, compared, estimates, noted, on_everything, score
from ..tracing.optima import other_optima


@dataclass(frozen=True, repr=False)
class Identification(Fitted):
    """Fitted parameters of the declared structure, with the errors before and after."""

    estimates: Mapping[str, Estimate]
    error: Mapping[str, Any]
    model: Model
    record: Record
    messages: tuple[str, ...]
    declared: Model | None = None
    traces: Traces | None = None
    map: FrictionMap | None = None
    provenance: Provenance | None = None
    verdict: ClassVar[str] = "identified"  # for reports and plots: nothing was added
    effects: ClassVar[tuple[()]] = ()
    depends_on: ClassVar[tuple[()]] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python; never NaN or Infinity."""
        nested = self.model.to_dict()
        return plain(
            {
                "schema": 1,
                "parameters": {k: v.summary() for k, v in self.estimates.items()},
                "error": self.error,
                "model": {k: nested[k] for k in ("plant", "friction", "effects")}
                | {"stated": self.model.statements()},
                "record": self.record.summary(),
                "messages": list(self.messages),
                "provenance": self.provenance.summary() if self.provenance else None,
            }
        )

    def _title(self) -> str:
        return f"Identification: {self.model.name}"

    def _rows(self) -> Iterable[Row]:
        rows = [estimated(k, e) for k, e in self.estimates.items()]
        return [*rows, *self._error_rows(("declared", "refitted")), *self._last_rows()]


@shows_progress
@one_blas_thread()
@stamped("lugrectl.identify")
def identify(
    record: Any,
    model: Any,
    *,
    holdout: Any = None,
    horizon: float = 1.0,
    seed: int = 0,
    progress: Wanted = None,
) -> Identification:
    """Fit the parameters of a declared model, without looking for missing effects.

    Parameters and errors are those of :func:`lugrectl.diagnose`; missing values are identified.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When the record cannot answer.
    """
    record, model, holdout = asked(record, model, holdout)
    horizon, seed = judged_by(horizon, seed)
    report = reporter(progress)
    if not isinstance(record, Record) and is_map(record):
        return _map_identified(begin_map(record, model, holdout, report), model)
    job = begin(record, model, holdout, horizon, report)
    whole = on_everything(job.base, job)
    job = noted(compared(job, whole), *at_bounds(whole), *far_off(whole, model))
    job = noted(job, *against_held(whole), *other_optima(whole))
    scored = score(job, job.base)
    error = scored["error"]
    return Identification(
        estimates=estimates(whole),
        error={k: v for k, v in error.items() if k != "augmented"},
        model=whole.predictor.model.with_values(whole.values),
        record=job.records[0],
        messages=job.messages,
        declared=model,
        traces=traces(job, job.base, scored["judged"]),
    )


def _map_identified(fits: Fits, declared: Model) -> Identification:
    """The declared friction fitted to all points of a map of runs at steady speed."""
    whole = refit(fits.base, fits.whole)
    error = errors_of(fits, fits.base)
    return Identification(
        estimates=estimates_of(whole),
        error={k: v for k, v in error.items() if k != "augmented"},
        model=final_model(fits, whole),
        record=fits.records[0],
        messages=messages_of(fits, whole),
        declared=declared,
        map=map_of(fits, {"refitted": fits.base}),
    )
