"""The study that diagnosis and identification share: data, hold-out, refitted model, errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..engine.runtime.backend import compiler
from ..estimates.covariance import Joint, Residuals, residuals_of
from ..estimates.findings import Estimate
from ..identification.balance import Balance
from ..identification.dataset.dataset import Data, prepare
from ..identification.dataset.derived_speed import on_theta_alone
from ..identification.dataset.folds import ENOUGH_OF_MANY, MOST, Split, split
from ..identification.dataset.kalman import Noise
from ..identification.dataset.run_effects import MOST_RUNS, alike, repeating, statements
from ..identification.dataset.windows import Windows, in_motion, spread, windows
from ..identification.likelihood.held_out_run import adapted
from ..identification.likelihood.initial_values import begun, completed, lifted
from ..identification.likelihood.likelihood import tune
from ..identification.likelihood.local_maxima import surest, with_others
from ..identification.likelihood.maximise import Fitted, identified_covariance, tuned
from ..identification.likelihood.predictor import Predictor
from ..identification.likelihood.simulation_error import Judged, free_run, judge, sensed_torque
from ..identification.selection import HeldOut
from ..record import Record, consistent, long_enough_to_judge, pooled

SLOWLY = "first guess (slow: there is neither a C compiler nor numba; install lugrectl[fast])"
UNIDENTIFIED = "{} cannot be identified separately from {}; only a combination is determined."
UNIDENTIFIED_ALONE = "{} cannot be identified from {}; its value is one choice among many."
EARLIER = (
    "The torque column lags the motion by {0:.2g} ms, as the log of another device does. It was "
    "shifted {0:.2g} ms earlier."
)
LOWERED = "w is {:.3g} {} too {}: friction turns over at that speed. It was taken off."

LAG = "velocity_sensor_lag"
GIVEN_UP = 100.0  # log-likelihood that a fit to all samples may lose on the first windows

Progress = Callable[[float, str], None]
_Models = dict[str, tuple[Predictor, Mapping[str, float], Noise] | None]


@dataclass(frozen=True)
class Job:
    """Records prepared for fitting and judging, and the best fit of the declared model."""

    records: tuple[Record, ...]
    declared: Model
    data: Data
    parts: Split
    base: Fitted
    doubts: tuple[str, ...] = ()

    @property
    def messages(self) -> tuple[str, ...]:
        """What was noticed about the model and the records."""
        noticed = (m for r in self.records for m in r.messages)
        return (*self.declared.remarks(), *noticed, *self.doubts)


@dataclass(frozen=True)
class Prepared:
    """Records prepared for fitting and judging, before any fit."""

    records: tuple[Record, ...]
    every: tuple[Record, ...]
    model: Model
    data: Data
    parts: Split
    doubts: tuple[str, ...]

    @property
    def held_out(self) -> HeldOut:
        """The samples on which errors are computed."""
        data, at = self.data, self.parts.test.counted
        return HeldOut(data.run[at[:, 0]], data.t[at[:, 0]], data.t[at[:, -1]])

    def from_values(self, plain: Mapping[str, float]) -> Prepared:
        """The same with values from which fits start."""
        return replace(self, data=replace(self.data, plain=plain))

    def earlier(self, by: float) -> Prepared:
        """The same with the torque earlier (s), where it was written down late: a simulation, too,
        needs the torque of its instant."""
        if not by:
            return self
        doubts = (*self.doubts, EARLIER.format(1e3 * by))
        return replace(self, data=self.data.earlier(by), doubts=doubts)

    def begun_from(
        self, plain: Balance, values: Mapping[str, float], late: float | None = None
    ) -> Prepared:
        """The same with values from which fits start, and with what is known of the channels: by
        the balance, the offset of a speed and a torque written down late; by the comparison, which
        knows more effects, how ``late`` (s)."""
        by = plain.written_late(self.data.dt) if late is None else late
        return self.lowered(plain).from_values(values).earlier(by)

    def lowered(self, plain: Balance) -> Prepared:
        """The same with the true speed, where one logged alone has an offset: friction turns over
        where the drive stands, not where w says so."""
        offset = plain.speed_offset
        if not offset or np.isfinite(self.data.noise.theta):
            return self
        unit = unit_for("rad/s", self.model.motion)
        said = LOWERED.format(abs(offset), unit, "high" if offset > 0.0 else "low")
        doubts = (*self.doubts, said)
        return replace(self, data=self.data.lowered(offset), doubts=doubts)


def prepared(
    record: Record | Sequence[Record],
    model: Model,
    holdout: str | Record | None,
    horizon: float,
) -> Prepared:
    """The records split into training and held-out samples; Refused where they cannot be judged."""
    records = (record,) if isinstance(record, Record) else tuple(record)
    apart = (holdout,) if isinstance(holdout, Record) else ()
    checked = map(consistent, (*records, *apart))  # a record made of arrays was not checked yet
    every = pooled([*checked])
    records = every[: len(records)]
    for one in every:
        long_enough_to_judge(one)
    data = prepare(every)
    held_out = sum(r.samples for r in records) if apart else None
    parts = split(data, horizon, last=holdout == "last", held_out=held_out)
    filtering = any(part.block.name == LAG for part in model.effects)
    alone = None if filtering else on_theta_alone(every, data)
    data, doubts = (data, ()) if alone is None else (alone[0], (alone[1],))
    if 1 < len(records) <= MOST_RUNS:
        data = replace(data, differing=tuple(range(1, len(records))))
    return Prepared(records, tuple(every), model, data, parts, doubts)


def begin(asked: Prepared, report: Progress) -> Job:
    """The declared model refitted to the training samples."""
    records, model, data, parts = asked.records, asked.model, asked.data, asked.parts
    base = _declared(model, data, parts.train, report)
    return Job(records, model, data, parts, base, asked.doubts)


def _declared(model: Model, data: Data, train: Windows, report: Progress) -> Fitted:
    """The best fit of the declared model, including its undeclared values."""
    report(0.02, "first guess" if compiler() else SLOWLY)
    started = lifted(completed(model, replace(data, differing=()), train))
    report(0.05, "refitting the declared model")
    return begun(Predictor(started, data), train, model)


def with_run_effects(job: Job, fitted: Fitted) -> tuple[Job, Fitted]:
    """The job and its final fit, both with what is a held-out run's own: neither is preferred."""
    test, declared = job.parts.test, job.declared
    return replace(job, base=adapted(job.base, test, declared)), adapted(fitted, test, declared)


def compared(job: Job, whole: Fitted, judged: Fitted | None = None) -> Job:
    """The same job with messages on how its runs differ: by the last fit, and of those held out
    by the fit that is judged."""
    judged = judged or whole
    seen = whole.predictor.data.differing
    held_out = tuple(run for run in judged.predictor.data.differing if run not in seen)
    said: list[str] = []
    for fitted, runs in ((whole, seen), (judged, held_out)):
        predictor = fitted.predictor
        data = replace(predictor.data, differing=runs)
        said += statements(data, fitted.values, repeating(predictor.model))
    return noted(job, *said)


def unidentified(flat: Sequence[Sequence[str]], source: str) -> list[str]:
    """A sentence for each direction that ``source`` does not identify, with its keys."""
    return [
        (UNIDENTIFIED if len(keys) > 1 else UNIDENTIFIED_ALONE).format(" and ".join(keys), source)
        for keys in flat
    ]


def noted(job: Job, *messages: str) -> Job:
    """The same job with more messages."""
    return replace(job, doubts=(*job.doubts, *messages))


def on_everything(fitted: Fitted, job: Job) -> Fitted:
    """Parameters from all samples of the training records, for use after the judging.

    A whole file or a last half that is held out stays so. The first fit is kept if the new one is
    far less likely on its windows: an effect that acted once, at the end, may be in none of the new
    windows.
    """
    if not job.parts.in_sample:
        return with_others(fitted)
    train = job.parts.train
    where = in_motion(windows(job.data.runs, train.burn, train.length), job.data.log.w)
    where = spread(where, MOST, ENOUGH_OF_MANY)
    opened = [k for k, v in job.declared.values().items() if v is None]
    whole = surest(fitted, where, opened)
    there = tuned(replace(fitted, values=whole.values))
    return whole if there.total > fitted.total - GIVEN_UP else fitted


def estimates(fitted: Fitted) -> dict[str, Estimate]:
    """Every fitted parameter with unit and 95 % interval, and the held ones."""
    model = fitted.predictor.model
    intervals = fitted.intervals()
    declared, held = model.declarations(), model.held()
    return {
        k: Estimate(v, model.unit(k), intervals.get(k), held=k in held)
        for k, v in fitted.values.items()
        if k in declared and declared[k].fitted
    }


def joint(fitted: Fitted) -> Joint:
    """The joint distribution of the free parameters: their covariance in SI units."""
    C, values, coords = identified_covariance(fitted), fitted.values, fitted.free
    slope = []
    for c in coords:  # of the value over its coordinate
        x = c.into(values)
        ahead = c.back(x + c.step, values) - values[c.key]
        slope.append(
            ahead / c.step if ahead else (values[c.key] - c.back(x - c.step, values)) / c.step
        )
    D = np.array(slope)
    found = np.array([values[c.key] for c in coords])
    positive = np.array([c.kind in ("log", "excess") for c in coords], bool) & (found > 0)
    return Joint(tuple(c.key for c in coords), found, C * np.outer(D, D), positive)


def residuals(fitted: Fitted) -> Residuals:
    """The tests of what the one-step predictions of a fit leave, of w where it is fitted."""
    channel = int(fitted.noise.recorded()[-1])
    e = fitted.innovations[..., channel]
    u = fitted.predictor.data.u[fitted.where.counted].reshape(e.shape)
    return residuals_of(("theta", "w")[channel], e, u)


def score(job: Job, final: Fitted) -> dict[str, Any]:
    """The three errors of the JSON format, and under "judged" what they were computed from.

    The torque is that of one observer, with the gain for the noise of the refitted model.
    """
    base, data, parts = job.base, job.data, job.parts
    models = _models(job, base, final)
    judged = {
        name: judge(*found, parts.test, base.noise) if found else None
        for name, found in models.items()
    }
    error = {
        "signal": data.signal,
        "unit": data.unit,
        "samples": int(parts.test.counted.size),
        "horizon": parts.test.length * data.dt,
        **{k: j.error if j else None for k, j in judged.items()},
        "noise_floor": float(data.floor),
        "fit": _fit(data.measured[parts.test.counted], judged),
    }
    torque = {k: j.torque if j else None for k, j in judged.items()}
    noise = sensed_torque(final.predictor, final.values, base.noise)
    torque["noise_floor"] = min([noise, *(x for x in torque.values() if x is not None)])
    unit = unit_for("N m", data.motion)
    free = _free_error(job, models)
    return {"error": error, "free_error": free, "torque_error": {"unit": unit, **torque},
            "judged": judged}  # fmt: skip


def _fit(measured: np.ndarray, judged: Mapping[str, Judged | None]) -> dict[str, float | None]:
    """How much of the motion a model simulates, in %: 100 (1 - RMS error / spread), NRMSE."""
    spread = max(float(np.std(measured)), 1e-300)
    return {k: 100.0 * (1.0 - j.error / spread) if j else None for k, j in judged.items()}


def _models(job: Job, base: Fitted, final: Fitted) -> _Models:
    """Predictor, values and noise of the declared, refitted and augmented model."""
    declared, given = None, job.declared.values()
    if None not in given.values():
        known = job.declared.known() | alike(base.predictor.data)
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
