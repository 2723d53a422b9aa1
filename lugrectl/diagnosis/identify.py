"""Fit the declared model alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..blocks.model import Model
from ..core.blas_threads import one_blas_thread
from ..core.display import Row, estimated
from ..core.errors import Refused
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.provenance import stamped
from ..estimates.fitted import Fitted
from ..torque_balance.constants import FLOOR
from ..torque_balance.plain import alone
from .asked import Asked, judged_by
from .balanced import Begun
from .compare_laws import under_law
from .mapped import of_map
from .result import INERTIA

NOTHING = "no value of the model is certain from this record alone, nor its inertia."
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
    report(0.0, "torque balance")
    begun = Begun.of(asked, horizon)
    made = alone(begun.parts, asked.model, begun.held_out)
    report(0.4, "errors on held-out samples")
    work = begun.ended(made, FLOOR)
    notes = work.notes(ONLY_PLAIN)
    fields = work.fields([*notes, *work.changes(), *work.plain.notes])
    error = (fields.pop("error") or {}).items()
    error = {k: v for k, v in error if k != "augmented"} or None
    found = Identification(error=error, **fields)
    if not (found.estimates or made.view.is_map):
        raise Refused(NOTHING, INERTIA)
    return of_map(found, made, asked) if made.view.is_map else found
