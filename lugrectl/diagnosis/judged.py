"""What an answer says of the model that won: its errors on held-out samples, and what is noted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..estimates.findings import Estimate, Traces
from ..identification.balance.result import Combination
from ..identification.likelihood.local_maxima import other_optima
from ..identification.likelihood.maximise import Fitted
from .never_worse import failure, refuse_without_inertia
from .one_direction import not_alone, one_way, shown_sums
from .other_law import means_the_same
from .parameter_changes import against_held, at_bounds, far_off
from .plot_data import residual_torque, traces
from .question import Asked
from .study import Job, compared, noted, score, unidentified, with_run_effects
from .winning_model import Winner


@dataclass(frozen=True)
class Judged:
    """The model that won beside what was held out.

    ``scored`` are the three errors of the JSON format. ``failed`` says why its values are none,
    which an own law can show only in simulation. ``sums`` are those that values stand for.
    """

    job: Job
    final: Fitted
    scored: Mapping[str, Any]
    traces: Traces
    estimates: dict[str, Estimate]
    failed: str | None
    sums: Mapping[str, Combination]


def judged(won: Winner, asked: Asked) -> Judged:
    """Errors, values and notes; Refused where the values do not determine the inertia."""
    failed, whole, model = _failed(won, asked), won.whole, asked.model
    refuse_without_inertia(won.estimates, model)
    job, final = with_run_effects(won.job, won.fit)
    scored = score(job, final)
    shown = traces(job, final, scored["judged"])
    job = compared(job, whole, final)
    job = noted(job, *unidentified(whole.flat(), "this record"), *((failed,) if failed else ()))
    job = noted(job, *at_bounds(whole), *against_held(whole), *other_optima(whole))
    sums = shown_sums(won.estimates, asked.plain)
    fitted = not_alone(won.estimates, sums, asked.plain)
    job = noted(job, *far_off(fitted, model), *one_way(fitted, sums, asked.plain, model))
    return Judged(job, final, scored, shown, fitted, failed, sums)


def _failed(won: Winner, asked: Asked) -> str | None:
    if not won.simulated or means_the_same(asked.model):
        return None
    job = won.job
    return failure(job.data, residual_torque(job, won.whole, won.whole.noise), asked)
