"""Fit the declared model alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..blocks.model import Model
from ..core.display import Row, estimated
from ..core.errors import Refused
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.provenance import Provenance, stamped
from ..core.result import plain as jsonable
from ..estimates.covariance import Joint, Residuals
from ..estimates.findings import Estimate, FrictionMap, Traces
from ..estimates.fitted import Fitted
from ..friction_maps.low_speed import as_shown
from ..friction_maps.points import is_map
from ..identification.balance import Balance
from ..identification.selection import alone
from ..parallel.blas_threads import one_blas_thread
from ..record import Record, unlikely_time
from .compare_laws import under_law
from .judged import judged
from .law_comparison import LawComparison
from .other_law import lacking
from .plain_answer import plainly
from .question import Asked, judged_by
from .refusal import with_plain
from .steady_runs import (
    Fits,
    begin_map,
    errors_of,
    estimates_of,
    final_model,
    map_of,
    messages_of,
)
from .study import prepared, residuals
from .winning_model import winner

ONLY_PLAIN = "The values are those of the torque balance alone, without errors of a simulation: {}"
OF_CHANNELS = frozenset(("u_delay", "w_gain", "w_offset", "w_lag", "drift"))


@dataclass(frozen=True, repr=False)
class Identification(Fitted):
    """Fitted parameters of the declared structure, with the errors before and after.

    Where only the torque balance can answer, ``error`` is None and ``estimates`` holds what it
    is certain of; ``plain`` is that balance in any case.
    """

    estimates: Mapping[str, Estimate]
    error: Mapping[str, Any] | None
    model: Model
    record: Record | None
    messages: tuple[str, ...]
    declared: Model | None = None
    traces: Traces | None = None
    map: FrictionMap | None = None
    provenance: Provenance | None = None
    plain: Balance | None = None
    joint: Joint | None = None
    residuals: Residuals | None = None
    laws: LawComparison | None = None
    records: tuple[Record, ...] = ()
    torque_noise: float | None = None
    rivals: ClassVar[tuple[()]] = ()
    verdict: ClassVar[str] = "identified"  # for reports and plots: nothing was added
    effects: ClassVar[tuple[()]] = ()
    depends_on: ClassVar[tuple[()]] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python; never NaN or Infinity."""
        nested = self.model.to_dict()
        return jsonable(
            {
                "schema": 1,
                "parameters": {k: v.summary() for k, v in self.estimates.items()},
                "error": self.error,
                "model": {k: nested[k] for k in ("plant", "friction", "effects")}
                | {"stated": self.model.statements()},
                "record": self.record.summary() if self.record else None,
                "laws": self.laws.summary() if self.laws else None,
                "records": self._records(),
                "messages": list(self.messages),
                "plain": self.plain.summary() if self.plain else None,
                "covariance": self.joint.summary() if self.joint else None,
                "members": self._drawn_from(),
                "drive": self._drive(),
                "residuals": self.residuals.summary() if self.residuals else None,
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
    law: str | None = None,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    progress: Wanted = None,
) -> Identification:
    """Fit the parameters of a declared model, without looking for missing effects.

    The values are those of the balances that :func:`lugrectl.diagnose` compares or, where the log
    is clean, of a fit by one-step predictions. An effect that is missing biases them.

    Parameters
    ----------
    record, model, holdout, horizon, seed, law, columns, units, scale, rate, progress
        As for :func:`lugrectl.diagnose`; missing values of the model are identified.

    Returns
    -------
    Identification
        Fitted values with 95 % intervals, the errors before and after, the model with these values.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When nothing is certain from this record; ``plain`` of the error says why.

    Examples
    --------
    A made-up log of a drive of which only J is known:

    >>> t = 1e-2 * np.arange(400)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> model = lg.Model.of(J=0.002, friction="coulomb")
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, model)
    >>> round(fit.model.friction.values["Fc"], 2)
    0.3
    """
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    if law is not None:
        options = {"holdout": holdout, "horizon": horizon, "seed": seed, "progress": progress}
        return under_law(identify, record, model, law, **options, **reading)
    asked = Asked.of(record, model, holdout, **reading)
    horizon, seed = judged_by(horizon, seed)
    report = reporter(progress)
    report(0.0, "torque balance")
    if asked.plain.hopeless:  # the plain answer first: it stands whatever follows
        no = Refused(" ".join(asked.plain.against))
        no.plain = asked.plain
        raise no
    try:
        found = _finer(asked, horizon, report)
    except Refused as no:
        found = _plainly(asked, no)
    return with_plain(found, asked)


def _plainly(asked: Asked, no: Refused) -> Identification:
    """What the torque balance knows where the finer fit is refused.

    Refused if it knows nothing of the drive; how its sensors behave is no answer, and no value is
    one as long as the unit of t is open.
    """
    plain, model = asked.plain, asked.model
    known = plain.parameters.keys() - OF_CHANNELS or plain.combinations
    if not known or any(unlikely_time(one) for one in asked.seen):
        no.plain = plain
        raise no
    known, answered = plainly(plain, model)
    said = asked.seen[0].messages if asked.seen and not asked.several else ()
    return Identification(
        estimates=known,
        error=None,
        model=answered,
        record=asked.seen[0] if asked.seen else None,
        messages=(*model.remarks(), *said, ONLY_PLAIN.format(no)),
        declared=model,
    )


def _finer(asked: Asked, horizon: float, report: Progress) -> Identification:
    """The model at its values with errors; Refused where the record cannot give them."""
    record, model = asked.records(), asked.model
    holdout = asked.holdout()
    if not isinstance(record, Record) and is_map(record):
        return _map_identified(begin_map(record, model, holdout, report), model)
    asked.refuse_unfit()
    ready = prepared(record, model, holdout, horizon)
    plain = asked.plain
    found = alone(plain.stretches, asked.completed, plain, held_out=ready.held_out)
    ready = ready.begun_from(plain, asked.starts(found.alone), found.written_late)
    won = winner(ready, found, report)
    own = judged(won, asked)
    if own.failed:
        raise Refused(own.failed)
    lacks = lacking(found, model, plain)
    return Identification(
        estimates=own.estimates,
        error={k: v for k, v in own.scored["error"].items() if k != "augmented"},
        model=won.whole.predictor.model.with_values(won.whole.values),
        record=own.job.records[0],
        messages=(*([lacks] if lacks else []), *own.job.messages),
        declared=model,
        traces=own.traces,
        joint=won.joint,
        residuals=residuals(won.whole),
        torque_noise=won.whole.torque_noise,
    )


def _map_identified(fits: Fits, declared: Model) -> Identification:
    """The declared friction fitted to all points of a map of runs at steady speed."""
    whole = as_shown(fits.everywhere, fits.declared)
    error = errors_of(fits, fits.base)
    return Identification(
        estimates=estimates_of(whole),
        error={k: v for k, v in error.items() if k != "augmented"},
        model=final_model(fits, whole),
        record=fits.records[0],
        messages=messages_of(fits, whole),
        declared=declared,
        map=map_of(fits, whole, {"refitted": fits.base}),
    )
