"""What diagnosis and identification share: data, hold-out, the refitted model, the errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..block import unit_for
from ..model import Model
from ..record import Record
from ..results import Estimate
from .data import Data, prepare
from .evaluate import Judged, free_run, judge
from .fit import Fitted, fit, free_keys, tune
from .noise import Noise
from .predictor import Predictor, windows
from .split import Split, split
from .start import completed

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Job:
    """Records laid out for fitting and judging, and the declared structure at its best."""

    records: tuple[Record, ...]
    declared: Model
    data: Data
    parts: Split
    base: Fitted

    @property
    def messages(self) -> tuple[str, ...]:
        """What was noticed about the model and the records."""
        return (*self.declared.remarks(), *(m for r in self.records for m in r.messages))


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
    data = prepare([*records, *apart])
    held_out = sum(r.samples for r in records) if apart else None
    parts = split(data, horizon, last=holdout == "last", held_out=held_out)
    report(0.02, "first guess")
    started = completed(model, data, parts.train)
    report(0.05, "refitting the declared model")
    predictor = Predictor(started, data)
    values = started.known()
    base = fit(predictor, values, free_keys(predictor), parts.train, data.noise)
    return Job(records, model, data, parts, base)


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
    judged = _judged(job, final)
    data, parts = job.data, job.parts
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
    free = _free_error(job, final)
    return {"error": error, "free_error": free, "torque_error": {"unit": unit, **torque},
            "judged": judged}  # fmt: skip


def _candidates(job: Job, final: Fitted) -> dict[str, tuple[Predictor, Mapping, Noise] | None]:
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


def _judged(job: Job, final: Fitted) -> dict[str, Judged | None]:
    return {
        name: judge(*found, job.parts.test, job.base.noise) if found else None
        for name, found in _candidates(job, final).items()
    }


def _free_error(job: Job, final: Fitted) -> dict[str, Any]:
    runs = job.parts.free
    errors = {
        name: free_run(*found, runs) if found else None
        for name, found in _candidates(job, final).items()
    }
    data = job.data
    return {"signal": data.signal, "unit": data.unit, "in_sample": job.parts.in_sample, **errors}
