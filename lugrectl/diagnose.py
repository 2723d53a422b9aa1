"""From a log and a declared model to the named missing effect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .block import members, unit_for
from .data import Data, prepare
from .evaluate import Judged, free_run, judge, missing_torque
from .fit import Fitted, fit, free_keys, tune
from .model import Model
from .predictor import Predictor, windows
from .record import Record
from .results import Candidate, Diagnosis, Estimate, Finding, Traces
from .search import Trial, refine, screen
from .split import Split, split
from .start import completed
from .structure import Dependence, dependences

GATE = 20.0  # least gain in log-likelihood, also without the best window
LEAST_SHARE = 0.04  # of the residual torque's power that an effect must remove
LEFT_SHARE = 0.05  # of the first residual's power that may still hang on a signal
MOST_EFFECTS = 3
TRIED = 3  # candidates fitted in full at each step

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class _Step:
    """One effect accepted, and what was tried beside it."""

    trial: Trial
    fitted: Fitted
    tied: tuple[Candidate, ...]


def diagnose(
    record: Record | Sequence[Record],
    model: Model,
    *,
    holdout: str | Record | None = None,
    horizon: float = 1.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find what physical effect a declared model lacks to explain a log.

    The declared model is refitted by the likelihood of its one-step predictions, so that a
    wrong parameter is not called a missing effect. Effects of the catalogue are tried jointly
    with a refit, and accepted when the gain holds over the training windows. Errors are those
    of simulations from the recorded torque alone, on samples that no step has seen.

    Parameters
    ----------
    record : Record or list of Record
        One run, or several of one rate.
    model : Model
        The declared model; missing values are identified.
    holdout : None, "last" or Record
        Every other block, the last half, or another run is held out.
    horizon : float
        Time between restarts of the simulation, s.
    seed : int
        Kept for steps that draw at random; none does at present.
    progress : callable
        ``progress(fraction, what)``.

    Returns
    -------
    Diagnosis

    Raises
    ------
    Refused
        When the record cannot answer.
    """
    report = progress or (lambda fraction, what: None)
    train_on = [record] if isinstance(record, Record) else list(record)
    judged_on = [holdout] if isinstance(holdout, Record) else []
    data = prepare([*train_on, *judged_on])
    held_out = sum(r.samples for r in train_on) if judged_on else None
    parts = split(data, horizon, last=holdout == "last", held_out=held_out)
    report(0.02, "first guess")
    started = completed(model, data, parts.train)
    report(0.05, "refitting the declared model")
    predictor = Predictor(started, data)
    base = fit(predictor, started.values(), free_keys(predictor), parts.train, data.noise)
    steps, first_screen, rest = _explain(base, report)
    report(0.85, "judging on held-out samples")
    final = _inside(steps[-1].fitted) if steps else base
    left = _left_over(base, final, data)
    return _conclude(model, data, parts, base, final, steps, first_screen, left, train_on, report)


def _explain(base: Fitted, report: Progress) -> tuple[list[_Step], list[Candidate], list[Trial]]:
    """Add the best effect, refit, look again, until nothing proven is left."""
    steps: list[_Step] = []
    ranking: list[Candidate] = []
    current, trials = base, []
    for turn in range(MOST_EFFECTS):
        at = 0.15 + 0.7 * turn / MOST_EFFECTS
        report(at, f"trying the catalogue, round {turn + 1}")
        trials = screen(current, _names(current.predictor.model))
        fits = []
        for trial in [t for t in trials if t.promise > 0.5 * GATE][:TRIED]:
            report(at + 0.05, f"fitting {trial.name}")
            fits.append((trial, refine(trial)))
        if turn == 0:
            ranking = _ranking(current, trials, fits)
        proven = [(t, f) for t, f in fits if _proven(current, f)]
        if not proven:
            break
        trial, best = max(proven, key=lambda pair: pair[1].total)
        steps.append(_Step(trial, best, _ties(current, best, fits)))
        current = best
    return steps, ranking, trials


def _names(model: Model) -> list[str]:
    """Effects worth trying: a second of a kind only where it can differ (another harmonic)."""
    used = {part.block.name for part in model.effects}
    return [
        name
        for name, made in members("effect").items()
        if name not in used or any(p.grid and p.unit != "s" for p in made.parameters.values())
    ]


def _proven(before: Fitted, after: Fitted) -> bool:
    gain = after.loglik - before.loglik
    return gain.sum() - max(gain.max(), 0.0) > GATE and _share(before, after) > LEAST_SHARE


def _share(before: Fitted, after: Fitted) -> float:
    """Part of the residual torque's power that is gone."""
    return 1.0 - (after.noise.torque / before.noise.torque) ** 2


def _ranking(
    base: Fitted, trials: Sequence[Trial], fits: Sequence[tuple[Trial, Fitted]]
) -> list[Candidate]:
    full = {t.name: f for t, f in fits}
    made = []
    for t in trials:
        f = full.get(t.name)
        values = f.values if f else t.values
        own = {k.split(".", 1)[1]: v for k, v in values.items() if k.startswith(t.key + ".")}
        score = f.total - base.total if f else t.promise
        made.append(Candidate(t.name, score, _share(base, f) if f else 0.0, own))
    return sorted(made, key=lambda c: -c.score)


def _ties(
    before: Fitted, best: Fitted, fits: Sequence[tuple[Trial, Fitted]]
) -> tuple[Candidate, ...]:
    """Others that explain the training windows as well within two standard errors."""
    tied = []
    for trial, fitted in fits:
        if fitted is best:
            continue
        lead = best.loglik - fitted.loglik
        error = float(np.std(lead, ddof=1)) * np.sqrt(len(lead))
        if lead.sum() < max(3.0, 2.0 * error) and _proven(before, fitted):
            score = fitted.total - before.total
            tied.append(Candidate(trial.name, score, _share(before, fitted)))
    return tuple(tied)


def _inside(found: Fitted) -> Fitted:
    """The same model with its effects inside the plant, fitted once more."""
    predictor = Predictor(found.predictor.model, found.predictor.data)
    free = free_keys(predictor)
    return fit(predictor, found.values, free, found.where, found.noise, rounds=2)


def _left_over(base: Fitted, final: Fitted, data: Data) -> tuple[Dependence, float, Dependence]:
    """What the residual torque hung on before; its share of that power now, and on what."""
    before = missing_torque(base.predictor, base.values, base.where, base.noise)
    after = missing_torque(final.predictor, final.values, final.where, base.noise)
    first = dependences(before, data.log, base.where.counted)[0]
    now = dependences(after, data.log, final.where.counted)[0]
    power = float(np.mean(after**2) / np.mean(before**2))
    return first, power * now.share, now


def _conclude(
    declared: Model,
    data: Data,
    parts: Split,
    base: Fitted,
    final: Fitted,
    steps: Sequence[_Step],
    ranking: Sequence[Candidate],
    left: tuple[Dependence, float, Dependence],
    records: Sequence[Record],
    report: Progress,
) -> Diagnosis:
    first, share, now = left
    structured = now.t > 3.0 and share > LEFT_SHARE and now.rms > 0.003 * float(np.std(data.u))
    tied = [c for step in steps for c in step.tied]
    if structured:
        verdict = "unexplained"
    elif not steps:
        verdict = "adequate"
    else:
        verdict = "ambiguous" if tied else "found"
    whole = _on_everything(final, parts, data) if parts.in_sample else final
    judged = _judged(declared, base, final, parts)
    depends = now.signals if structured else _inputs(steps)
    return Diagnosis(
        verdict=verdict,
        effects=tuple(_finding(step, whole, declared.motion) for step in steps),
        depends_on=depends,
        experiment=_experiment(verdict, steps, depends),
        error=_error(data, parts, judged),
        free_error=_free_error(data, parts, declared, base, final),
        torque_error={"unit": unit_for("N m", data.motion)} | {
            k: j.torque if j else None for k, j in judged.items()
        },
        model=whole.predictor.model.with_values(whole.values),
        declared=declared,
        estimates=_estimates(whole),
        record=records[0],
        messages=tuple(m for r in records for m in r.messages),
        ranking=tuple(ranking),
        traces=_traces(data, parts, base, final, judged),
    )  # fmt: skip


def _on_everything(final: Fitted, parts: Split, data: Data) -> Fitted:
    """Parameters from all samples, after the errors have been measured without them."""
    where = windows(list(data.runs), parts.train.burn, parts.train.length)
    free = free_keys(final.predictor)
    return fit(final.predictor, final.values, free, where, final.noise, rounds=6)


def _judged(
    declared: Model, base: Fitted, final: Fitted, parts: Split
) -> dict[str, Judged | None]:
    values = declared.values()
    given: Judged | None = None
    if None not in values.values():
        noise, _ = tune(base.predictor, values, base.where, base.noise)
        given = judge(base.predictor, values, noise, parts.test, base.noise)
    return {
        "declared": given,
        "refitted": judge(base.predictor, base.values, base.noise, parts.test, base.noise),
        "augmented": judge(final.predictor, final.values, final.noise, parts.test, base.noise),
    }


def _error(data: Data, parts: Split, judged: Mapping[str, Judged | None]) -> dict:
    return {
        "signal": data.signal,
        "unit": data.unit,
        "samples": int(parts.test.counted.size),
        "horizon": parts.test.length * data.dt,
        **{k: j.error if j else None for k, j in judged.items()},
        "noise_floor": float(data.noise.w if data.signal == "w" else data.noise.theta),
    }


def _free_error(data, parts: Split, declared: Model, base: Fitted, final: Fitted) -> dict:
    values = declared.values()
    given = None
    if None not in values.values():
        given = free_run(base.predictor, values, base.noise, parts.free)
    return {
        "signal": data.signal,
        "unit": data.unit,
        "in_sample": parts.in_sample,
        "declared": given,
        "refitted": free_run(base.predictor, base.values, base.noise, parts.free),
        "augmented": free_run(final.predictor, final.values, final.noise, parts.free),
    }


def _estimates(fitted: Fitted) -> dict[str, Estimate]:
    model, intervals = fitted.predictor.model, fitted.intervals()
    return {k: Estimate(v, model.unit(k), intervals.get(k)) for k, v in fitted.values.items()}


def _finding(step: _Step, fitted: Fitted, motion: str) -> Finding:
    all_of = _estimates(fitted)
    prefix = step.trial.key + "."
    own = {k.removeprefix(prefix): e for k, e in all_of.items() if k.startswith(prefix)}
    return Finding(step.trial.name, own, step.tied)


def _inputs(steps: Sequence[_Step]) -> tuple[str, ...]:
    """The signals that the effects found hang on."""
    made: list[str] = []
    for step in steps:
        block = members("effect")[step.trial.name]
        made += (["t"] if block.timed else []) + list(block.inputs)
        made += ["w"] if "Fc" in block.acts and "w" not in made else []
    return tuple(dict.fromkeys(made))


_ADVICE = {
    "theta": "record slow moves over the same positions in both directions at two speeds",
    "w": "record constant speeds from slow to fast in both directions",
    "t": "repeat the same run cold and warm, and log temperature and load beside it",
    "u": "record the same motion with a known added load, so that torque and motion differ",
    "a": "record the same move at two accelerations",
}


def _experiment(
    verdict: str, steps: Sequence[_Step], depends: Sequence[str]
) -> str | None:
    if verdict == "ambiguous":
        step = next(s for s in steps if s.tied)
        block = members("effect")[step.trial.name]
        others = " or ".join(c.name for c in step.tied)
        return f"To tell {step.trial.name} from {others}: {block.experiment}."
    if verdict == "unexplained":
        return f"To see what it is: {_ADVICE[depends[0]]}."
    return None


def _traces(data, parts: Split, base: Fitted, final: Fitted, judged) -> Traces:
    n = len(data.t)
    held_out = np.zeros(n, dtype=bool)
    held_out[parts.test.counted] = True
    simulated = {}
    for name, j in judged.items():
        if j is not None:
            simulated[name] = np.full(n, np.nan)
            simulated[name][parts.test.counted] = j.simulated
    everything = windows(list(data.runs), parts.train.burn, parts.train.length)
    residual = {}
    for name, f in (("refitted", base), ("augmented", final)):
        residual[name] = np.full(n, np.nan)
        torque = missing_torque(f.predictor, f.values, everything, base.noise)
        residual[name][everything.counted] = torque
    log = data.log
    signals = {"t": log.t, "theta": log.theta, "w": log.w, "u": log.u}
    return Traces(data.t, data.y[:, data.channel], held_out, simulated, residual, signals)
