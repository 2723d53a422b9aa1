"""Fit the declared model alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

from ..blocks.model import Model
from ..core.display import Row, estimated
from ..core.errors import Refused
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.provenance import stamped
from ..estimates.fitted import Fitted
from ..parallel.blas_threads import one_blas_thread
from ..torque_balance.base import alone
from ..torque_balance.constants import FLOOR
from ..torque_balance.model_values import model_values
from ..torque_balance.plain import plain_balance
from .asked import Asked, judged_by
from .balanced import NO_INERTIA, knows_inertia, ready_of, same_values, simulated
from .compare_laws import under_law
from .contradictions import contradicted, unfit_law
from .mapped import judged_on, of_map
from .moved_values import at_bounds, moved
from .refusal import noted
from .simulation import residuals

ONLY_PLAIN = "The values are those of the torque balance alone, without errors of a simulation: {}"


@dataclass(frozen=True, repr=False, kw_only=True)
class Identification(Fitted):
    """Fitted parameters of the declared structure, with the errors before and after.

    Where only the torque balance can answer, ``error`` is None and ``estimates`` holds what it
    is certain of; ``plain`` is that balance in any case.
    """

    model: Model
    verdict: ClassVar[str] = "identified"  # for reports and plots: nothing was added
    effects: ClassVar[tuple[()]] = ()
    depends_on: ClassVar[tuple[()]] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python; never NaN or Infinity."""
        return self._document()

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
    horizon, _ = judged_by(horizon, seed)
    try:
        return identified(asked, horizon, reporter(progress))
    except Refused as no:  # the plain answer stands all the same
        no.plain = asked.plain
        raise


def identified(asked: Asked, horizon: float, report: Progress) -> Identification:
    """The values of the declared model; Refused where the record cannot give any."""
    start, model = perf_counter(), asked.model
    asked.records()
    asked.refuse_open_time()
    report(0.0, "torque balance")
    doubts = asked.doubts()
    ready, why_not = ready_of(asked, horizon)
    parts, held_out = judged_on(asked, () if ready is None else ready.held_out)
    made = alone(parts, model, held_out)
    found = made.last, made.interval, made.values, made.covariance
    report(0.4, "errors on held-out samples")
    values = model_values(*found, model)
    plain = plain_balance(*found, made.sure, asked.stretches)
    sure = knows_inertia(plain, model)
    judged, values, noise, why_not = simulated(
        ready if sure else None, made, values, FLOOR, why_not
    )
    plain = same_values(plain, values)
    values = values.beside(plain.combinations)
    values = values if sure else values.told(model)
    law = unfit_law(made, values.model, plain, FLOOR)
    doubts = doubts or asked.doubts(plain) or contradicted(asked.stretches, model)
    notes = [*([law] if law else []), *doubts]
    notes += [ONLY_PLAIN.format(no)] if (no := why_not) else []
    notes += [NO_INERTIA] if not (why_not or sure or made.view.is_map) else []
    notes += [
        *(() if judged is None else judged.messages),
        *moved(values.estimates, model),
        *at_bounds(values.estimates, model),
    ]
    keys = () if judged is None else judged.error.keys() - {"augmented"}
    answer = Identification(
        estimates=values.estimates,
        error=None if judged is None else {k: v for k, v in judged.error.items() if k in keys},
        model=values.model,
        record=asked.seen[0],
        records=tuple(asked.seen),
        messages=noted(asked, [*notes, *plain.notes]),
        declared=model,
        traces=None if judged is None else judged.traces,
        plain=asked.completed(plain, perf_counter() - start),
        joint=values.joint,
        residuals=None if ready is None or judged is None else residuals(ready, values.model),
        torque_noise=noise,
    )
    return of_map(answer, made, asked) if made.view.is_map else answer
