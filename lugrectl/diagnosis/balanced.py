"""From a log and a declared model to the named missing effect, by the torque balance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..core.deadline import OutOfTime
from ..core.errors import InputError, Refused
from ..core.option_names import option
from ..core.progress import Progress
from ..estimates.balance import Balance
from ..estimates.comparison import Comparison
from ..estimates.findings import Candidate, Estimate, Finding
from ..estimates.members import Belief
from ..record import Record
from ..torque_balance.budget import comparison, refuse_unjudged, signals
from ..torque_balance.last_fit import LastFit
from ..torque_balance.maps import is_map
from ..torque_balance.model_values import (
    ModelValues,
    as_estimates,
    completed,
    lifted,
    model_values,
    with_scale,
)
from ..torque_balance.own_law import told_by_balance
from ..torque_balance.plain import plain_balance
from ..torque_balance.tabulated import tabulated
from ..torque_balance.verdict import WHOLE_INERTIA, Answer, answer
from .asked import Asked
from .contradictions import unfit_law
from .experiments import longer, next_experiment, short
from .mapped import judged_on, of_map
from .moved_values import at_bounds, moved
from .refusal import noted
from .result import Diagnosis
from .simulation import Judged, Prepared, errors, polish, prepared, residuals, torque_noise

NO_MOTION = "The errors of a simulation are left out: {}"
NO_INERTIA = (
    "The log does not determine the inertia, and none is declared: what is named does not depend "
    "on it, and no motion is simulated."
)
STOPPED = "the fit was stopped at its limit of time."
MORE_TIME = "Give it more time with {}, or a shorter part of the record."
WORSE = (
    "On held-out samples the simulation with the added effect misses the motion by {0:.3g} {2}, "
    "without it by {1:.3g}: the torque error falls, the motion error does not."
)
OTHER_PLACES = (
    "the drive passes most places once, so that few are both in training and in held-out samples. "
    "The torque errors are of shorter parts in turn."
)
PLACES, SLOW = 36, 0.01  # in a turn or travel; of the top speed: slower has no direction
LONGER = (2.7, 3.7, 5.3)  # s: lengths of blocks, where those of 2 s see one half of the motion each


def diagnosed(asked: Asked, horizon: float, seed: int, least: float, alpha: float,
              report: Progress) -> Diagnosis:  # fmt: skip
    """The answer; Refused where the record cannot give one."""
    start = perf_counter()
    model = asked.model
    asked.records()
    asked.refuse_open_time()
    doubts = asked.doubts()
    ready, why_not = ready_of(asked, horizon)
    parts, held_out = judged_on(asked, () if ready is None else ready.held_out)
    report(0.0, "torque balance")
    report(0.1, "comparing explanations")
    made = answer(parts, model, held_out, least, alpha)
    values = model_values(made.last, made.interval, made.values, made.covariance, model, made.parts)
    found = comparison(made, least, alpha)
    refuse_unjudged(found)
    report(0.6, "errors on held-out samples")
    plain = plain_balance(
        made.last, made.interval, made.values, made.covariance, made.sure, asked.stretches
    )
    sure = knows_inertia(plain, model)
    judged, values, noise, why_not = simulated(
        ready if sure else None, made, values, least, why_not
    )
    plain = asked.completed(same_values(plain, values), perf_counter() - start)
    values = values.beside(plain)
    values = values if sure else values.told(model)
    effects = _findings(made, values, found, model)
    doubts = doubts or asked.doubts(plain)
    law = unfit_law(made, values.model, plain, least)
    notes = [*([law] if law else []), *doubts, *_said(made, judged, why_not, plain, sure)]
    notes += [*moved(values.estimates, model), *at_bounds(values.estimates, model)]
    stretches = None if made.view.is_map else found.stretches
    notes += [*short(asked.seen, stretches)]
    unfit = bool(law) and made.verdict == "adequate"  # friction depends on w in another way
    verdict, signals_ = ("unexplained", ("w",)) if unfit else (made.verdict, _signals(made))
    experiment = next_experiment(verdict, signals_, effects, plain, sure)
    rest = None if ready is None or judged is None else residuals(ready, values.model)
    made_of = Diagnosis(
        verdict=verdict,
        effects=effects,
        depends_on=signals_,
        experiment=longer(asked.seen, stretches, experiment),
        error=None if judged is None else judged.error,
        free_error=None if judged is None else judged.free_error,
        torque_error=_torque_error(made, model),
        model=values.model,
        declared=model,
        estimates=values.estimates,
        record=asked.seen[0],
        records=tuple(asked.seen),
        messages=noted(asked, notes),
        ranking=_ranking(found),
        traces=None if judged is None else judged.traces,
        table=tabulated(made.last, signals_) if verdict == "unexplained" else None,
        comparison=found,
        joint=values.joint,
        residuals=rest,
        rivals=_beliefs(made, values),
        torque_noise=noise,
        plain=plain,
    )
    return of_map(made_of, made, asked) if made.view.is_map else made_of


def ready_of(asked: Asked, horizon: float) -> tuple[Prepared | None, Refused | None]:
    """The records split for simulations, or why they cannot be.

    Where every other block sees one half of a periodic motion, blocks are longer.
    """
    if is_map(asked.stretches):  # nothing moves that could be simulated
        return None, None
    records = asked.records()
    given = [records] if isinstance(records, Record) else records
    holdout = asked.holdout()
    try:
        ready = prepared(given, asked.model, holdout, horizon)
        if holdout is not None or _same_motion(ready):
            return ready, None
    except Refused as no:
        return None, no
    for length in LONGER:
        with suppress(Refused):
            ready = prepared(given, asked.model, holdout, horizon, length)
            if _same_motion(ready):
                return ready, None
    return None, Refused(OTHER_PLACES)


def _same_motion(ready: Prepared) -> bool:
    """Whether most held-out samples lie at angles that training samples pass the same way."""
    seen: list[set[int]] = [set(), set()]
    for i, run in enumerate(ready.runs):
        turn = (
            2 * np.pi if ready.model.motion == "rotary" else max(float(np.ptp(run.theta)), 1e-300)
        )
        place = np.floor(run.theta / turn * PLACES) % PLACES
        way = np.sign(run.speed) * (np.abs(run.speed) > SLOW * np.abs(run.speed).max())
        at = (3 * place + way).astype(int)
        out = np.zeros(len(run.t), bool)
        for own, start, end in ready.held_out:
            out |= (own == i) & (run.t >= start) & (run.t <= end)
        for own, where in ((~out, 0), (out, 1)):
            seen[where] |= set(np.flatnonzero(np.bincount(at[own] + 1)).tolist())
    return len(seen[0] & seen[1]) > 0.5 * len(seen[1])


def knows_inertia(plain: Balance, model: Model) -> bool:
    """Whether the log determines the inertia, or it is declared."""
    return "J" in plain.parameters or model.known().get("J") is not None


def simulated(
    ready: Prepared | None, made: Answer, values: ModelValues, least: float, why_not: Refused | None
) -> tuple[Judged | None, ModelValues, float | None, Refused | None]:
    """Errors before and after, and values of a last polish where the log is clean, or the law has
    values of which the balance knows nothing; and why there are none."""
    if ready is None:
        return None, values, None, why_not
    model = made.view.model
    ready = as_it_acts(ready, made)
    refitted = completed(made.refitted or made.last, model)
    trained = completed(made.trained or made.last, model, made.parts)
    try:
        own_law = not told_by_balance(model)
        if (_clean(made, least) or own_law) and not made.only_inertia:
            finer, own = _polished(ready, trained, values, own_law)
            if own_law or torque_noise(ready, finer) < least * made.view.size:
                trained, values = finer, own
                named = bool(made.named or made.parts)
                refitted = _polished(ready, refitted, values, own_law)[0] if named else trained
        full = None if None in model.values().values() else model
        models = {"declared": full, "refitted": refitted, "augmented": trained}
        return errors(ready, models), values, torque_noise(ready, values.model), why_not
    except OutOfTime:  # all else is known
        return None, values, None, Refused(STOPPED, MORE_TIME.format(option("time_limit")))
    except Refused as no:
        return None, values, None, no
    except InputError as no:
        return None, values, None, Refused(str(no))


def as_it_acts(ready: Prepared, made: Answer) -> Prepared:
    """The same without what the columns of the runs have beside the torque and the speed."""
    known = _offsets(made.last), _late(made), made.view.w_above[0]
    return ready.as_it_acts(*known) if any(known) else ready


def polished_values(ready: Prepared, made: Answer) -> Model:
    """The model of training rows, at its likeliest values by one-step predictions."""
    trained = completed(made.trained or made.last, made.view.model)
    values = model_values(made.last, made.interval, made.values, made.covariance, made.view.model)
    always = not told_by_balance(made.view.model)
    return _polished(ready, trained, values, always)[0]


def _clean(made: Answer, least: float) -> bool:
    """Whether next to nothing stays beside the model, so that a finer fit may be valid."""
    return made.with_names.stays < 2 * least * made.view.size


def _polished(
    ready: Prepared, trained: Model, values: ModelValues, always: bool = False
) -> tuple[Model, ModelValues]:
    """Values by one-step predictions, begun from those of the balance."""
    model = values.model
    free = [k for k, p in model.declarations().items() if p.fitted and k not in model.held()]
    free = [k for k in free if k in trained.values()]
    made = polish(ready, lifted(trained, ready.model), free, values.joint, always)
    if not made.gained:
        return trained, values
    polished = trained.with_values(made.values)
    joint = with_scale(made.joint)
    estimates = as_estimates(joint, polished)
    rest = {k: e for k, e in values.estimates.items() if k not in estimates}
    rest = {k: replace(e, value=made.values[k]) for k, e in rest.items() if k in made.values}
    known = {**values.estimates, **rest, **estimates}
    model = values.model.with_values(made.values)
    all_values = replace(values, model=model, estimates=known, joint=joint)
    return polished, all_values


def _offsets(last: LastFit) -> dict[int, float]:
    """What the torque of each run has beside the model, N m."""
    d, b = last.design, last.fit.b
    at = [j for j, n in enumerate(d.names) if n == "run"]
    own = dict(zip(last.view.with_offset.tolist(), b[at].tolist(), strict=True))
    every = last.values["offset"] if d.constant else 0.0
    return {r: every + own.get(r, 0.0) for r in np.unique(last.view.motion.run).tolist()}


def _late(made: Answer) -> float:
    """How late the torque acts beyond its hold, s, where no effect says so."""
    x = made.values["late"]
    certain = x[1] > 0 or x[2] < 0
    late = x[0] * made.view.longest_hold
    return late if certain and abs(late) > 0.5 * made.view.motion.dt else 0.0


def same_values(plain: Balance, values: ModelValues) -> Balance:
    """The plain part with the values of a polish: one quantity has one value."""
    known = values.estimates
    same = {k: known[k] if k in known and known[k].ci95 is not None else e
            for k, e in plain.parameters.items()}  # fmt: skip
    return replace(plain, parameters=same)


def _torque_error(made: Answer, model: Model) -> dict[str, Any]:
    """RMS torque error in windows of held-out samples."""
    floor = min(float(np.sqrt(made.view.noise)) * abs(made.values["J"][0]), made.with_names.error)
    return {
        "unit": unit_for("N m", model.motion),
        "declared": made.declared_error,
        "refitted": made.without.error,
        "augmented": made.with_names.error,
        "noise_floor": floor,
    }


def _findings(
    made: Answer, values: ModelValues, found: Comparison, model: Model
) -> tuple[Finding, ...]:
    """The effects with their values and the alternatives to each."""

    def tied(name: str) -> tuple[Candidate, ...]:
        return tuple(_candidate(found, other) for other in made.alternatives.get(name, ()))

    effects = []
    if made.lag is not None:
        lag = Estimate(made.lag[0], "s", made.lag[1:])
        effects.append(Finding("velocity_sensor_lag", {"time_constant": lag}))
    if made.only_inertia:
        effects.insert(0, Finding(WHOLE_INERTIA, {}, tied(WHOLE_INERTIA)))
    declared = {p.key for p in model.effects}  # a map shows some of them only
    parts = [p for p in values.model.effects if p.key not in declared]
    for part in parts:
        own = {k: values.estimates[f"{part.key}.{k}"] for k in part.block.own
               if f"{part.key}.{k}" in values.estimates}  # fmt: skip
        effects.append(Finding(part.block.name, own, tied(part.key)))
    return tuple(effects)


def _candidate(found: Comparison, name: str) -> Candidate:
    return next((c for c in _ranking(found) if c.name == name), Candidate(name, 0.0, 0.0))


def _ranking(found: Comparison) -> tuple[Candidate, ...]:
    rows = [row for row in found.rows[1:] if not row.model.startswith("unknown(")]
    return tuple(Candidate(row.model, row.elpd, row.torque) for row in rows)


def _signals(made: Answer) -> tuple[str, ...]:
    if made.verdict == "unexplained":
        return tuple(made.depends_on)
    return tuple(dict.fromkeys(s for t in made.named for s in signals(t.block)))


def _beliefs(made: Answer, values: ModelValues) -> tuple[Belief, ...]:
    """The models that explain the record as well as the first."""
    others = made.rivals
    weight = 1.0 / (len(others) + 1)
    beliefs = []
    for last in others:
        model = completed(last, made.view.model)
        shared = {k: e for k, e in values.estimates.items() if k in model.known()}
        beliefs.append(Belief.of(model, None, shared, weight))
    return tuple(beliefs)


def _said(
    made: Answer, judged: Judged | None, why_not: Refused | None, plain: Balance, sure: bool
) -> Sequence[str]:
    notes = [*made.notes]
    if made.candidates:
        notes.append(
            f"Candidates that are not certain: {', '.join(dict.fromkeys(made.candidates))}."
        )
    if why_not is not None:
        notes.append(NO_MOTION.format(f"{why_not} {why_not.experiment or ''}".rstrip()))
    elif not (sure or made.view.is_map):
        notes.append(NO_INERTIA)
    if judged is not None:
        notes += [*judged.messages, *_worse(judged.error, bool(made.named or made.parts))]
    return [*notes, *plain.notes]


def _worse(error: Mapping[str, Any], named: bool) -> list[str]:
    before, after = error["refitted"], error["augmented"]
    if not named or before is None or after is None or after <= before:
        return []
    return [WORSE.format(after, before, error["unit"])]
