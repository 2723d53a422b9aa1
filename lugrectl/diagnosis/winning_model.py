"""The fit of the one model that won: values, intervals and errors come from its predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ..blocks.model import Model
from ..identification.dataset.run_effects import alike
from ..identification.likelihood.initial_values import likeliest
from ..identification.likelihood.maximise import Fitted, fit, tuned
from ..identification.likelihood.parameters import free_keys
from ..identification.likelihood.predictor import Predictor
from ..identification.selection import Comparison, Named
from .study import Job, Progress, as_recorded

TIMES = {"input_delay", "actuator_lag"}


@dataclass(frozen=True)
class Winner:
    """The fitted model with the named effects, and their keys in it.

    ``compared`` are the values from which the fit started, the effects as the comparison has them.
    """

    job: Job
    fit: Fitted
    keys: tuple[str, ...]
    compared: Mapping[str, float] | None = None

    def as_compared(self) -> Winner:
        """The model at the values of the comparison, where a fit by simulation fails."""
        if self.compared is None:
            return self
        values = {**self.fit.values, **self.compared}
        return replace(self, fit=tuned(replace(self.fit, values=values)), compared=None)


def with_effects(job: Job, found: Comparison, report: Progress) -> Winner:
    """The model with the effects that the comparison names, fitted to the training samples.

    From the values of the comparison, with friction as it, the plain answer or the refitted model
    has it: whichever predicts best. The inertia is that of the comparison. A torque that was moved
    is used as recorded where a time is named.
    """
    if TIMES & {e.name for e in found.effects}:
        job = as_recorded(job, report)
    if not found.effects:
        return Winner(job, job.base, ())
    job = _aligned(job, found.effects)
    model, keys, values = _model(job.base.predictor.model, found.effects)
    predictor, base = Predictor(model, job.base.predictor.data), job.base
    plant = {k: v for k, v in found.plant.items() if k in base.values and v > 0}
    balanced = {k: v for k, v in job.data.plain.items() if k in base.values and v > 0}
    inertia = {k: v for k, v in plant.items() if k == "J"}  # without that of a load on a spring
    starts = [base.values | own | inertia | values for own in (plant, balanced, {})]
    start = likeliest(predictor, base.where, base.noise, starts)
    free, anchor = free_keys(predictor), base.anchor | values
    final = fit(predictor, start.values, free, base.where, start.noise, anchor=anchor)
    return Winner(job, final, keys, start.values)


def _aligned(job: Job, effects: Sequence[Named]) -> Job:
    """The same with theta of each run from where effects have one phase in all of them."""
    effect = next((e for e in effects if e.zeros), None)
    if effect is None:
        return job
    data = job.data.aligned(effect.zeros, float(effect.values["harmonic"]))
    values = alike(data) | job.base.values
    base = replace(job.base, predictor=job.base.predictor.on(data), values=values)
    return replace(job, data=data, base=base)


def _model(
    model: Model, effects: Sequence[Named]
) -> tuple[Model, tuple[str, ...], dict[str, float]]:
    keys, values = [], {}
    for effect in effects:
        model = model.with_effect(effect.name, effect.values)
        part = model.effects[-1]
        keys.append(part.key)
        values |= {f"{part.key}.{k}": float(v) for k, v in part.values.items() if v is not None}
    return model, tuple(keys), values
