"""What diagnosis and identification share: data, hold-out, the refitted model, the errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model import Model
from ..record import Record
from ..results import Estimate
from ..spec import unit_for
from .coordinates import free_keys
from .data import Data, averaged, prepare
from .doubts import refuse_dead, refuse_unfit
from .evaluate import free_run, judge
from .fit import Fitted, fit
from .likelihood import tune
from .noise import Noise
from .predictor import Predictor, windows
from .split import Split, split
from .start import completed, settled

CALM = 50.0  # least gain in log-likelihood for a smoothed torque
CALMEST = 5  # times that it may be averaged over three samples
SMOOTHED = "u is noisy from sample to sample: it was averaged over neighbouring samples."

Progress = Callable[[float, str], None]
_Models = dict[str, tuple[Predictor, Mapping[str, float], Noise] | None]


@dataclass(frozen=True)
class Job:
    """Records laid out for fitting and judging, and the declared structure at its best."""

    records: tuple[Record, ...]
    declared: Model
    data: Data
    parts: Split
    base: Fitted
    doubts: tuple[str, ...] = ()

    @property
    def messages(self) -> tuple[str, ...]:
        """What was noticed about the model and the records."""
        smoothed = (SMOOTHED,) if self.data.smoothed else ()
        noticed = (m for r in self.records for m in r.messages)
        return (*self.declared.remarks(), *noticed, *self.doubts, *smoothed)


def begin(
    record: Record | Sequence[Record],
    model: Model,
    holdout: str | Record | None,
    horizon: float,
    report: Progress,
) -> Job:
    """Split the records and refit the declared model on the part that may be seen."""
    records = (record,) if isinstance(record, Record) else tuple(record)
    apart = (holdout,) if isinstance(holdout, Record) else ()
    every = [*records, *apart]
    refuse_dead(every)
    data = prepare(every)
    held_out = sum(r.samples for r in records) if apart else None
    parts = split(data, horizon, last=holdout == "last", held_out=held_out)
    doubts = refuse_unfit(every, model, data)
    report(0.02, "first guess")
    started = completed(model, data, parts.train)
    report(0.05, "refitting the declared model")
    predictor = Predictor(started, data)
    values = started.known()
    base = settled(fit(predictor, values, free_keys(predictor), parts.train, data.noise))
    calm = calmed(base)
    if calm is not None:
        report(0.1, "refitting with the torque smoothed")
        predictor = predictor.on(calm)
        data, noise = calm, base.noise
        base = fit(predictor, base.values, free_keys(predictor), parts.train, noise, anchor=values)
    return Job(records, model, data, parts, base, doubts)


def calmed(base: Fitted) -> Data | None:
    """The data with the torque averaged over neighbouring samples, where that is more likely.

    Noise on the recorded torque, which the drive never saw, would otherwise make any effect
    look real that smooths the torque (a delay between two samples does).
    """
    data, found, total = base.predictor.data, None, base.total
    for _ in range(CALMEST):
        calmer = [data.with_torque(averaged(data.u, part, data.runs)) for part in (0.3, 1.0)]
        on = [tune(base.predictor.on(c), base.values, base.where, base.noise)[1] for c in calmer]
        totals = [float(loglik.sum()) for loglik in on]
        best = int(np.argmax(totals))
        if totals[best] < total + CALM:
            break
        data = found = calmer[best]
        total = totals[best]
    return found


def on_everything(fitted: Fitted, job: Job) -> Fitted:
    """Parameters from all samples of the training records, for use after the judging.

    Where a whole file or the last half is held out, it stays so.
    """
    if not job.parts.in_sample:
        return fitted
    train = job.parts.train
    where = windows(job.data.runs, train.burn, train.length)
    predictor = fitted.predictor
    free, anchor = free_keys(predictor), fitted.anchor
    return fit(predictor, fitted.values, free, where, fitted.noise, anchor=anchor)


def estimates(fitted: Fitted) -> dict[str, Estimate]:
    """Every fitted parameter with unit and 95 % interval."""
    model, intervals = fitted.predictor.model, fitted.intervals()
    declared = model.declarations()
    return {
        k: Estimate(v, model.unit(k), intervals.get(k))
        for k, v in fitted.values.items()
        if declared[k].fitted
    }


def score(job: Job, final: Fitted) -> dict[str, Any]:
    """The three errors of the JSON format, and under "judged" what they were counted on."""
    models, data, parts = _models(job, final), job.data, job.parts
    judged = {
        name: judge(*found, parts.test, job.base.noise) if found else None
        for name, found in models.items()
    }
    floor = data.noise.w if data.signal == "w" else data.noise.theta
    error = {
        "signal": data.signal,
        "unit": data.unit,
        "samples": int(parts.test.counted.size),
        "horizon": parts.test.length * data.dt,
        **{k: j.error if j else None for k, j in judged.items()},
        "noise_floor": float(floor),
    }
    torque = {k: j.torque if j else None for k, j in judged.items()}
    unit = unit_for("N m", data.motion)
    free = _free_error(job, models)
    return {"error": error, "free_error": free, "torque_error": {"unit": unit, **torque},
            "judged": judged}  # fmt: skip


def _models(job: Job, final: Fitted) -> _Models:
    """Predictor, values and noise of the declared, refitted and augmented model."""
    base, given = job.base, job.declared.values()
    declared = None
    if None not in given.values():
        known = job.declared.known()
        noise, _ = tune(base.predictor, known, base.where, base.noise)
        declared = base.predictor, known, noise
    return {
        "declared": declared,
        "refitted": (base.predictor, base.values, base.noise),
        "augmented": (final.predictor, final.values, final.noise),
    }


def _free_error(job: Job, models: _Models) -> dict[str, Any]:
    runs = job.parts.free
    errors = {name: free_run(*found, runs) if found else None for name, found in models.items()}
    data = job.data
    return {"signal": data.signal, "unit": data.unit, "in_sample": job.parts.in_sample, **errors}
